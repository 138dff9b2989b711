"""The figures: what is drawn, that no text is cut, and that a file is whole or absent."""

from collections.abc import Iterator

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from PIL import Image

from repaint_cli.errors import StoreError
from repaint_cli.report import look
from repaint_cli.report.curves import plot_curves, spread
from repaint_cli.report.trajectories import Paths, plot_racer, plot_reacher

NAN = np.nan
ANGLES = np.linspace(0, 2 * np.pi, 60)
RING = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
OVAL = {"inner": RING * [3.0, 1.5], "centre": RING * [3.4, 1.9], "outer": RING * [3.8, 2.3]}


@pytest.fixture
def drawn(monkeypatch) -> Iterator[list[Figure]]:
    """The figures saved during a test, still open to questions."""
    figures: list[Figure] = []
    save = look.save
    monkeypatch.setattr(
        look, "save", lambda figure, path: (save(figure, path), figures.append(figure))
    )
    return figures


def curves(n_seeds=3, n_iterations=20, best=400.0):
    noise = np.random.default_rng(0).normal(0, 20, (n_seeds, n_iterations))
    return best * (1 - np.exp(-np.arange(n_iterations) / 5)) + noise


def laps(label="iteration 5 · return 212 · progress 63 %", n_episodes=4):
    turns = np.linspace(0, 5, 80) + np.arange(n_episodes)[:, None]
    xy = np.stack([3.4 * np.cos(turns), 1.9 * np.sin(turns)], axis=2)
    xy[0, 28:30] *= 1.6  # off the map
    xy[0, 30:] = NAN
    speed = np.where(np.isnan(xy[:, :, 0]), NAN, 0.7 + 0.3 * np.sin(turns))
    return Paths(xy, label, speed=speed, ended_off=np.arange(n_episodes) == 0)


def reaches(label="iteration 60 · return −4.9", n_episodes=20):
    generator = np.random.default_rng(0)
    goals = generator.uniform(-0.14, 0.14, (n_episodes, 2))
    share = np.linspace(0, 0.95, 51)[:, None]
    return Paths(goals[:, None] * share + (1 - share) * [0.21, 0.0], label, target=goals)


def overhang(figure):
    """How far what is drawn sticks out of the figure, in pixels; 0 if nothing is cut."""
    box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    return figure.dpi * max(-box.x0, -box.y0, box.x1 - width, box.y1 - height, 0.0)


def draw_every_kind(folder):
    methods = {name: curves(best=300 + 20 * i) for i, name in enumerate(look.METHOD_COLOURS)}
    progress = {name: np.clip(values / 4, 0, 100) for name, values in methods.items()}
    plot_curves(
        methods,
        folder / "curves.png",
        title="racer-outer: transfer from racer-inner, " + "a title on two lines, " * 4,
        progress=progress,
        reference=(380.0, "scratch’s best"),
        transfer_iterations=4,
    )
    plot_curves({"scratch": curves(1)}, folder / "one.png", title="reacher")
    for count in (1, 2, 4, 6):
        plot_racer([laps()] * count, **OVAL, path=folder / f"racer{count}.png", title="racer-outer")
        plot_reacher([reaches()] * count, folder / f"reacher{count}.png", "reacher")


def test_nothing_is_cut_and_every_file_is_a_picture(drawn, tmp_path):
    draw_every_kind(tmp_path)
    assert len(drawn) == 10
    assert max(overhang(figure) for figure in drawn) <= 1.0
    for figure in drawn:  # and nothing pushed the panels into a corner
        assert sum(axes.bbox.width * axes.bbox.height for axes in figure.axes) > 0.4 * np.prod(
            figure.bbox.size
        )
    for path in tmp_path.iterdir():
        with Image.open(path) as picture:
            assert picture.format == "PNG"


def test_axes_have_names_and_units(drawn, tmp_path):
    path, share = tmp_path / "x.png", {"repaint": curves() / 4}
    plot_curves({"repaint": curves()}, path, title="t", progress=share)
    plot_racer([laps()], **OVAL, path=path, title="t")
    plot_reacher([reaches()], path, "t")
    names = [[axes.get_ylabel() for axes in figure.axes] for figure in drawn]
    assert names[0] == ["mean evaluation return", "mean lap progress [%]"]
    assert names[1:] == [["y [m]", "speed [m/s]"], ["y [m]", "time [steps]"]]
    assert [figure.axes[-1 if i == 0 else 0].get_xlabel() for i, figure in enumerate(drawn)] == [
        "iteration",
        "x [m]",
        "x [m]",
    ]


def test_the_same_figure_is_the_same_file(tmp_path):
    for name in ("a.png", "b.png"):
        plot_curves({"repaint": curves()}, tmp_path / name, title="reacher")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def bold_line(axes, label):
    (line,) = (line for line in axes.lines if line.get_label() == label)
    return line


def test_a_seed_that_stops_ends_the_mean_but_not_the_others(drawn, tmp_path):
    returns = np.array([[1.0, 2.0, 3.0, NAN], [3.0, 4.0, 5.0, 9.0]])
    plot_curves({"repaint": returns}, tmp_path / "c.png", title="t")
    (axes,) = drawn[0].axes
    assert_allclose(bold_line(axes, "repaint").get_xydata(), [[1, 2], [2, 3], [3, 4]])
    assert_allclose(axes.lines[1].get_xydata()[-1], [4, 9])


def test_only_three_seeds_or_more_have_a_band(drawn, tmp_path):
    for n_seeds in (1, 2, 3):
        plot_curves({"repaint": curves(n_seeds)}, tmp_path / "c.png", title="t")
    assert [len(figure.axes[0].collections) for figure in drawn] == [0, 0, 1]


@pytest.mark.parametrize("shape", [(0, 5), (2, 0), (3, 1), (1, 1)], ids=str)
def test_little_data_is_no_error(shape, tmp_path):
    plot_curves({"repaint": np.ones(shape)}, tmp_path / "c.png", title="t")
    plot_curves({"repaint": np.full(shape, NAN)}, tmp_path / "c.png", title="t")


def test_a_method_keeps_its_colour_whatever_else_is_drawn():
    alone = look.colours_of(["repaint"])
    among = look.colours_of(["racer-inner", "kickstart", "repaint", "repaint ζ 0.4"])
    assert among["repaint"] == alone["repaint"] == look.METHOD_COLOURS["repaint"]
    assert len(set(among.values())) == 4


def test_names_move_apart_and_no_farther_than_needed():
    assert spread([0.1, 0.5], 0.1) == [0.1, 0.5]
    assert_allclose(spread([0.5, 0.5, 0.5], 0.1), [0.4, 0.5, 0.6])
    assert_allclose(spread([0.0, 0.5, 0.52], 0.1), [0.0, 0.46, 0.56])
    assert spread([], 0.1) == []


def test_paths_end_where_the_episode_ends_and_the_cross_is_there(drawn, tmp_path):
    paths = laps()
    plot_racer([paths], **OVAL, path=tmp_path / "t.png", title="t")
    axes = drawn[0].axes[0]
    segments = axes.collections[0].get_segments()
    assert len(segments) == 29 + 3 * 79
    assert_allclose(axes.lines[-1].get_xydata(), paths.xy[:1, 29])
    assert_allclose(axes.collections[0].get_array()[:29], paths.speed[0, 1:30])


def test_a_car_far_off_the_track_is_still_in_the_picture(drawn, tmp_path):
    plot_racer([laps(), laps()], **OVAL, path=tmp_path / "t.png", title="t")
    for axes in drawn[0].axes[:2]:
        assert axes.viewLim.contains(*laps().xy[0, 29])


def test_panels_share_one_speed_scale(drawn, tmp_path):
    slow, fast = laps(), laps()
    slow.speed[:] *= 0.3
    plot_racer([slow, fast], **OVAL, path=tmp_path / "t.png", title="t")
    left, right = (axes.collections[0].norm for axes in drawn[0].axes[:2])
    assert (left.vmin, left.vmax) == (right.vmin, right.vmax)
    assert left.vmin < 0.3 < 0.9 < left.vmax


def test_paths_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="speed is"):
        Paths(np.zeros((2, 5, 2)), "x", speed=np.zeros((2, 4)))


class Torn(Figure):
    """A figure that fails while it is written."""

    def savefig(self, path, **_):
        path.write_text("new")
        raise RuntimeError("half way")


def test_a_failure_leaves_the_old_file_and_no_scraps(tmp_path):
    path = tmp_path / "curves.png"
    path.write_text("old")
    with pytest.raises(RuntimeError, match="half way"):
        look.save(Torn(), path)
    assert [entry.name for entry in tmp_path.iterdir()] == ["curves.png"]
    assert path.read_text() == "old"


def test_a_file_in_the_way_is_explained(tmp_path):
    (tmp_path / "run").write_text("a file where the folder should be")
    with pytest.raises(StoreError, match="cannot write"):
        plot_curves({"repaint": curves()}, tmp_path / "run" / "curves.png", title="t")
