#!/bin/sh
# The main job with the real commands, printed as they go; everything lands in demo/.
set -eu
rm -rf demo && mkdir demo && cd demo

show() {
    printf '\n\033[1m$ %s\033[0m\n' "$*"
    "$@"
}

# A driver of the inner lane, and a task that pays for the outer lane: the opposite reward.
show repaint similarity racer-inner racer-outer
show repaint transfer --task racer-outer --method scratch --iterations 6 --seeds 2 --run runs/racer-outer/scratch
show repaint transfer --teacher racer-inner --task racer-outer --iterations 6 --seeds 2 --run runs/racer-outer/taught
show repaint eval --render-offscreen
show repaint compare runs/racer-outer/scratch runs/racer-outer/taught --output racer-outer.png

# An arm that moves with little torque, and a task that pays less for that: a similar reward.
show repaint transfer --task reacher --method scratch --iterations 20 --seeds 2 --run runs/reacher/scratch
show repaint transfer --teacher reacher-gentle --task reacher --iterations 20 --seeds 2 --run runs/reacher/taught
show repaint compare runs/reacher/scratch runs/reacher/taught --output reacher.png

printf '\nAn illustration: two seeds and a few iterations show how it works, not how well; for that see docs/results.md.\n'
printf 'Look at demo/racer-outer.png, demo/reacher.png and demo/runs/racer-outer/taught/video.mp4\n'
