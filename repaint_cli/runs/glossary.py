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
     "training were repeated: a 95 % t interval over seeds. Whether two runs differ is better "
     "seen from the interval of their difference. With one seed there is none."),
    ("steps", "Environment steps", "Actions taken in the environment by one seed while it learned, "
     "its teachers' counted, evaluations not."),
    ("seconds", "Time", "Of the clock since training began; evaluations, and what teachers played "
     "before, are counted, compiling is not. It depends on the machine; environment steps do not."),
    ("first", "Jump-start (first)", "The mean return of the first evaluation, after one iteration: "
     "what a teacher is worth at once."),
    ("area", "Area", "The area under the learning curve divided by its length: the mean return "
     "over the iterations that all runs have. It rewards learning early as well as learning much."),
    ("best", "Best", "The highest point of the mean curve."),
    ("final", "Final", "The last evaluation: its interquartile mean over seeds, the mean of the "
     "middle half, which one lucky or unlucky seed moves little; with fewer than four seeds "
     "nothing can be left out, and it is the mean."),
    ("steps-area", "Area by steps", "The same over environment steps instead of iterations, "
     "where an iteration of one method has more steps than one of another: over the steps that "
     "all seeds of all runs have, straight lines between evaluations."),
    ("difference", "Difference, pairs", "How far a run lies above the one it is compared with. "
     "Seeds share their first weights and their evaluation episodes, so runs are compared pair "
     "by pair of the same seed, with the t interval of these differences; runs that share fewer "
     "than two seeds with Welch's interval of two means."),
    ("better", "P(X > Y)", "How probable it is that a seed of this run earns more than one of "
     "the reference, over all pairs of seeds; 0.5 is alike. Its interval is Newcombe's."),
    ("needed", "Seeds needed", "About how many seeds a side would show a difference of this "
     "size: with 80 % power, at p = 0.05. The size itself is uncertain, so this is an order of "
     "magnitude."),
    ("target", "Target", "A return to reach. Where none was asked for, shares of what the "
     "reference converged to, the mean of the last fifth of its mean curve: 0 % is its first "
     "evaluation. In the paper it is the best mean return of the reference."),
    ("censored", "Iterations that a seed needed", "The mean over seeds of the first iteration "
     "at a target. A seed that does not get there counts as the last iteration, in both runs: "
     "the area under the Kaplan-Meier curve up to there. The log-rank test compares whole "
     "arrivals."),
    ("k", "K, the paper's measure", "The first iteration at which the mean return over seeds is "
     "at the target, as in table 1 of the REPAINT paper; “never” if it does not get there. Its "
     "target is the best of a noisy curve, so identical methods often differ by it. (In "
     "settings, K is also the last iteration with a teacher, transfer.iterations.)"),
    ("reduced", "Reduced", "How much of the reference's K, or of its time, was saved: 1 − K / "
     "K of the reference. 50 % is twice as fast; ×2 is twice as late."),
    ("p", "p", "How often so large a difference from the reference would come up if both "
     "methods were alike: the signs of the paired differences, or the seeds of two groups, are "
     "permuted. Small is sure; with three pairs it cannot be below 0.25, with five not below "
     "0.06."),
    ("profile", "Performance profile", "Which share of the seeds ended at or above a score. A "
     "run whose line is above another's everywhere is better at every rank, from its worst "
     "seed to its best, not only on average."),
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
    "seeds": "seed", "jump-start": "first", "first": "first", "area": "area", "best": "best",
    "final": "final", "area by steps": "steps-area", "by steps": "steps-area",
    "difference in area": "difference", "pairs": "difference", "P(X > Y)": "better",
    "seeds needed": "needed",
    "p": "p", "K": "k", "K reduced": "reduced", "time": "seconds", "time reduced": "reduced",
    "steps": "steps", "each seed's K": "k", "iteration": "iteration",
}  # fmt: skip
"""The anchor that the head of a column leads to."""
