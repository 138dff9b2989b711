"""Images as networks read them."""

from functools import reduce
from operator import add

import torch
from torch import Tensor


def brightness(images: Tensor, pool: int) -> Tensor:
    """Return images (B, H, W, C) uint8 as numbers in [0, 1], (B, C, H/pool, W/pool).

    Squares of pool × pool pixels are averaged; adding strided views is what torch does fastest.
    """
    x = images.permute(0, 3, 1, 2).to(torch.float32)
    height, width = (size // pool * pool for size in x.shape[2:])
    x = reduce(add, [x[..., i:height:pool, :] for i in range(pool)])
    x = reduce(add, [x[..., i:width:pool] for i in range(pool)])
    return x / (255 * pool * pool)
