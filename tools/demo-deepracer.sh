#!/bin/sh
# A DeepRacer's way with the real commands, printed as they go; everything lands in demo-deepracer/.
set -eu
rm -rf demo-deepracer && cp -r examples/deepracer demo-deepracer && cd demo-deepracer

show() {
    printf '\n\033[1m$ %s\033[0m\n' "$*"
    "$@"
}

# From the folder of DeepRacer-for-Cloud to a card, and what its reward function does.
show repaint tasks from-drfc run.env custom_files --output my-task.toml
show repaint tasks check my-task.toml

# A shipped driver learns the new reward; a lap on film, and a race of three laps with penalties.
show repaint transfer --teacher racer-inner --task my-task.toml --iterations 4 --run runs/my-race
show repaint eval runs/my-race --episodes 5 --render-offscreen
show repaint eval runs/my-race --race --episodes 3

# Its laps in the tools of DeepRacer, and back: what would another reward function have paid?
if python -c 'import deepracer.logs' 2>/dev/null; then
    show python laps.py runs/my-race/deepracer/seed-0
else
    printf '\nNot shown: python laps.py runs/my-race/deepracer/seed-0, which needs pip install deepracer-utils\n'
fi
show repaint tasks replay runs/my-race/deepracer/seed-0 --task faster.toml

printf '\nAn illustration: four iterations show how it works, not how well.\n'
printf 'Look at video.mp4 and progress.png in demo-deepracer/runs/my-race/, and at demo-deepracer/faster-replay.png\n'
