"""Frames into an MP4 that every browser plays: H.264, 4:2:0, the index in front."""

from collections.abc import Generator, Iterable
from functools import cache
from pathlib import Path

import imageio_ffmpeg  # type: ignore[import-untyped]
import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from repaint_cli.activity import progress
from repaint_cli.files.atomic import atomic_write
from repaint_cli.report.style import INK

Frame = NDArray[np.uint8]
"""One picture, (H, W, 3)."""

CAPTION_HEIGHT = 56

ENCODER_TIMEOUT = 60.0
"""Of the encoder after the last frame, s."""


def write_video(frames: Iterable[Frame], path: Path, fps: float) -> None:
    """Encode frames and put the film in the place of `path`, whole or not at all.

    Args:
        frames: pictures (H, W, 3), all of the first one's size; an odd side is padded by a pixel.
        path: of the MP4.
        fps: frames a second.

    Raises:
        StoreError: the file cannot be written.
        ValueError: there is no frame, or a frame has another size than the first.
    """
    rest = iter(frames)
    first = next(rest, None)
    if first is None:
        raise ValueError("a video needs at least one frame")
    with atomic_write(path) as scratch:
        encoder = _encoder(scratch, _even(first).shape, fps)
        try:
            encoder.send(_even(first))
            for number, frame in enumerate(rest, 2):
                if frame.shape != first.shape:
                    raise ValueError(f"a frame is {frame.shape}, the first one is {first.shape}")
                encoder.send(_even(frame))
                progress(number, None, "frames")
        finally:
            encoder.close()


def _encoder(
    path: Path, shape: tuple[int, ...], fps: float
) -> "Generator[None, Frame | None, None]":
    """Start the encoder and return the generator that takes frames."""
    height, width, _ = shape
    encoder: Generator[None, Frame | None, None] = imageio_ffmpeg.write_frames(
        str(path),
        (width, height),
        fps=fps,
        codec="libx264",
        quality=None,
        macro_block_size=1,
        ffmpeg_log_level="error",
        ffmpeg_timeout=ENCODER_TIMEOUT,
        output_params=["-preset", "veryfast", "-crf", "20", "-movflags", "+faststart"],
    )
    encoder.send(None)
    return encoder


def _even(frame: Frame) -> Frame:
    """Repeat the last row or column where a side is odd; H.264 halves the colours' resolution."""
    height, width, _ = frame.shape
    padded = np.pad(frame, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    return np.ascontiguousarray(padded, dtype=np.uint8)


def caption(frame: Frame, title: str, status: str) -> Frame:
    """Return the frame with a white strip beneath for two texts, (H + 56, W, 3)."""
    height, width, _ = frame.shape
    picture = Image.new("RGB", (width, height + CAPTION_HEIGHT), "white")
    picture.paste(Image.fromarray(frame), (0, 0))
    pen = ImageDraw.Draw(picture)
    for text, row, weight in ((title, 17, "-Bold"), (status, 40, "")):
        letters = font(15, weight)
        while letters.getlength(text) > width - 20 and letters.size > 8:
            letters = font(int(letters.size) - 1, weight)
        pen.text((width / 2, height + row), text, INK, letters, anchor="mm")
    return np.asarray(picture)


@cache
def font(size: int, weight: str = "") -> ImageFont.FreeTypeFont:
    """Return DejaVu Sans, which comes with matplotlib; `weight` is "" or "-Bold"."""
    fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    return ImageFont.truetype(str(fonts / f"DejaVuSans{weight}.ttf"), size)
