"""The region network in PyTorch: `torch_unet.py SECONDS RESULT` writes training steps and predictions
per second on one thread, as one JSON object, to RESULT."""

import json
import sys
import time

import torch
from torch import nn
from torch.nn import functional


class Block(nn.Module):
    def __init__(self, inputs, outputs):
        super().__init__()
        self.first = nn.Conv2d(inputs, outputs, 3, padding=1)
        self.second = nn.Conv2d(outputs, outputs, 3, padding=1)

    def forward(self, x):
        return torch.relu(self.second(torch.relu(self.first(x))))


class UNet(nn.Module):
    def __init__(self, width, levels, patch):
        super().__init__()
        self.patch = patch
        channels = [width << level for level in range(levels)]
        inputs = [2 * patch * patch] + channels[:-1]
        self.down = nn.ModuleList(Block(a, b) for a, b in zip(inputs, channels))
        steps = channels[-2::-1]
        self.rise = nn.ModuleList(nn.Conv2d(2 * to, 4 * to, 1) for to in steps)
        self.up = nn.ModuleList(Block(2 * to, to) for to in steps)
        self.head = nn.Conv2d(width, 11 * patch * patch, 1)

    def forward(self, x):
        x = functional.pixel_unshuffle(x, self.patch)
        skips = []
        for level, block in enumerate(self.down):
            if level > 0:
                skips.append(x)
                x = functional.max_pool2d(x, 2)
            x = block(x)
        for rise, up in zip(self.rise, self.up):
            x = functional.pixel_shuffle(rise(x), 2)
            x = up(torch.cat([x, skips.pop()], 1))
        return functional.pixel_shuffle(self.head(x), self.patch)


def loss(logits, critical, free, headings, headed):
    weight = 1.0 + critical
    miss = functional.binary_cross_entropy_with_logits(logits[:, :1], critical, weight, reduction="none")
    heading = -(headings * torch.log_softmax(logits[:, 1:], 1)).sum(1, keepdim=True) * headed
    return (miss * free).sum() / free.sum() + 0.1 * heading.sum() / headed.sum()


def rate(work, seconds):
    work()
    count, begun = 0, time.perf_counter()
    while count == 0 or time.perf_counter() - begun < seconds:
        work()
        count += 1
    return count / (time.perf_counter() - begun)


def measure(name, network, seconds, result):
    optimizer = torch.optim.Adam(network.parameters(), 2e-3)
    targets = [torch.rand(8, planes, 120, 120) for planes in (1, 1, 10, 1)]
    images = torch.rand(8, 2, 120, 120)

    def step():
        optimizer.zero_grad()
        loss(network(images), *targets).backward()
        optimizer.step()

    result[f"train.{name}"] = rate(step, seconds)
    for size, pixels in ((15, 120), (48, 384)):
        image = torch.rand(1, 2, pixels, pixels)
        with torch.no_grad():
            result[f"predict.{name}.{size}m"] = rate(lambda: network(image), seconds)


def main():
    torch.set_num_threads(1)
    torch.manual_seed(1)
    seconds = float(sys.argv[1])
    result = {"name": f"pytorch {torch.__version__}"}
    measure("compact", UNet(24, 3, 2), seconds, result)
    measure("plain", UNet(16, 4, 1), seconds, result)
    with open(sys.argv[2], "w") as file:
        json.dump(result, file)


main()
