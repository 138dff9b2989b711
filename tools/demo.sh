#!/bin/sh
# The main job with the real commands, printed as they go; everything lands in demo/.
set -eu
rm -rf demo && mkdir demo && cd demo

show() {
    printf '\n\033[1m$ %s\033[0m\n' "$*"
    "$@"
}

show repaint similarity racer-inner racer-outer
show repaint transfer --task racer-outer --method scratch --iterations 8 --run runs/racer-outer/scratch
show repaint transfer --teacher racer-inner --task racer-outer --iterations 8 --run runs/racer-outer/repaint
show repaint eval --render-offscreen
show repaint compare runs/racer-outer/scratch runs/racer-outer/repaint --output racer-outer.png

show repaint similarity reacher-gentle reacher
show repaint transfer --task reacher --method scratch --iterations 20 --run runs/reacher/scratch
# The tasks are alike (cosine 0.894), so the student may lean on the teacher longer than by default.
show repaint transfer --teacher reacher-gentle --task reacher --iterations 20 --run runs/reacher/repaint \
    --beta 1 --transfer-iterations 15 --set select.scale=student-batch
show repaint compare runs/reacher/scratch runs/reacher/repaint --output reacher.png

printf '\nLook at demo/racer-outer.png, demo/reacher.png and demo/runs/racer-outer/repaint/video.mp4\n'
