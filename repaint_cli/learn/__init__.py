"""The paper: collect, estimate advantages, select, update, repeat. Read `ppo` first.

Axes in every shape comment: S seeds trained side by side · T steps · N environments per seed · B
samples per seed · K kept samples · O observation · A action · F reward terms. No files and no
printing here.
"""
