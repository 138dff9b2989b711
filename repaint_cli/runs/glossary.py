"""What the numbers of a run mean, in plain words, for its page."""

GLOSSARY = (
    ("return", "Return", "The sum of an episode's rewards, as the task weighs them. The number of "
     "an evaluation is the mean over its episodes, in which the policy takes its most likely "
     "actions. More is better."),
    ("iteration", "Iteration", "One round of training: play with the current policy, learn from "
     "what was played, evaluate."),
    ("seed", "Seed", "The number that all chance of a training comes from. Several seeds are "
     "several trainings that share nothing but their settings; how far they differ is luck."),
    ("interval", "Interval [low, high]", "Where the mean over seeds would likely be if the "
     "training were repeated: a 95 % percentile bootstrap over seeds. Two runs whose intervals "
     "overlap widely may differ by luck alone. With one seed there is none."),
    ("steps", "Environment steps", "Actions taken in the environment by one seed while it learned, "
     "its teachers' counted, evaluations not."),
    ("seconds", "Time", "Of the clock since training began, evaluations counted, compiling not. It "
     "depends on the machine; environment steps do not."),
    ("first", "Jump-start (first)", "The mean return of the first evaluation, after one iteration: "
     "what a teacher is worth at once."),
    ("area", "Area", "The area under the learning curve divided by its length: the mean return "
     "over the iterations that all runs have. It rewards learning early as well as learning much."),
    ("best", "Best", "The highest point of the mean curve."),
    ("final", "Final", "The last evaluation: its interquartile mean over seeds, the mean of the "
     "middle half, which one lucky or unlucky seed moves little."),
    ("target", "Target", "A return to reach. Where none was asked for it is the best mean return "
     "of the run that others are compared with."),
    ("k", "K", "The first iteration at which the mean return over seeds is at the target, as in "
     "table 1 of the REPAINT paper; “never” if it does not get there. (In settings, K is "
     "also the last iteration with a teacher, transfer.iterations.)"),
    ("reduced", "Reduced", "How much of the reference's K, or of its time, was saved: 1 − K / "
     "K of the reference. 50 % is twice as fast; ×2 is twice as late."),
    ("p", "p", "How often so large a difference in area from the reference would come up if both "
     "methods were alike: a permutation test over seeds. Small is sure; with three seeds against "
     "three it cannot be below 0.1."),
    ("teacher", "Teacher and student", "A policy trained before, on another task, and the one that "
     "learns now."),
    ("representation", "Representation transfer, β", "The student plays and learns by itself, and "
     "is also pulled towards the teacher's actions. β (beta) is the weight of that pull; it "
     "falls from iteration to iteration. Alone it is called kickstarting."),
    ("instance", "Instance transfer, ζ", "The teacher plays the student's task, and the student "
     "learns from those of its samples that were better than expected: whose advantage is at least "
     "ζ (zeta), the threshold."),
    ("kept", "Kept share", "Which part of the teacher's samples passed that test."),
    ("negative", "Negative transfer", "Learning worse with a teacher than without. Alarms are its "
     "signs during training."),
)  # fmt: skip
"""Of each word its anchor, its name and what it means, in the order in which they are read."""

MEANING_OF = {
    "seeds": "seed", "jump-start": "first", "area": "area", "best": "best", "final": "final",
    "p": "p", "K": "k", "K reduced": "reduced", "time": "seconds", "time reduced": "reduced",
    "steps": "steps", "each seed's K": "k", "iteration": "iteration",
}  # fmt: skip
"""The anchor that the head of a column leads to."""
