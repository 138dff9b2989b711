"""Each iteration's laps with deepracer-utils, as the analysis notebooks have them."""

import sys

from deepracer.logs import AnalysisUtils, DeepRacerLog

log = DeepRacerLog(sys.argv[1])
log.load()
laps = AnalysisUtils.simulation_agg(log.dataframe())
print(laps.groupby("iteration")[["steps", "progress", "time", "reward"]].mean().round(1))
