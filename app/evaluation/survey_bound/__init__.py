"""
The least mean error that any method can have from the survey that was driven.

The Cramer-Rao bound (`app.evaluation.bound`) takes the true curves as known. A map knows them by
noisy readings at some places, and shadowing is rough between these. `best_answers` is the Bayes
estimator that is told the simulator's law, where every survey reading was truly taken, and nothing
else: its answer has the least expected distance from the truth, so that no method which learns
from the same readings has a lower mean error over cities and windows, unless it knows more. One
thing it lets be: that a cell was *not* heard is taken to say nothing. Asked of a city whose
receivers hear everything it knows more than a method can; the true bound lies between the two.

`curves` says what readings leave open of a cell's level, `roads` what the survey leaves open of
every road, `odometers` what distances may be, `places` how probable a window's readings are at each
place, `best` what to answer, and `strangers` how likely a window is to come from none of these
roads.
"""

from app.evaluation.survey_bound.best import Best, best_answers
from app.evaluation.survey_bound.odometers import ANY, Odometers
from app.evaluation.survey_bound.strangers import on_map_log

__all__ = ["ANY", "Best", "Odometers", "best_answers", "on_map_log"]
