"""What must be exceeded for something to be said: every threshold of the diagnosis, in one record."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Measured on simulated campaigns with known truth."""

    chance: float = 3e-5
    """A candidate is significant below this probability: with some 30 candidates, one wrong call in 1,000 diagnoses."""
    chance_curve: float = 1e-6
    """The same for a free-form curve, of which there are some 150, whose many columns make tests less sure."""
    least_gain: float = 4.0
    """Cross-validated fall of the cost below which no candidate is taken seriously, whatever its significance."""
    least_gain_curve: float = 15.0
    """The same for a curve."""
    clear_odds: float = 25.0
    """Log odds of unseen blocks that speak for a candidate where its significance rests on a few blocks and stays low;
    false names came to 20: a controller that answers gusts looks like a little less thrust per speed. It also confirms
    where held-out flights cannot tell."""
    clear_odds_curve: float = 16.0
    """The same for a curve; innocent models came to 11, and one to 35."""
    doubtful: float = 1e-3
    """... and the probability of chance that is low enough then."""
    doubtful_curve: float = 1e-2
    """The same for a curve: with a dozen columns and some fifty blocks the plain test has little power left."""
    least_size: float = 0.05
    """Sizes below this share of the usual one are of no consequence, however significant."""
    matters: float = 0.3
    """Share of the usual size from which an effect matters: excluded is what lies below it with its whole interval,
    but see `weak_sign`.
    Effects that campaigns hide begin at about a third of the usual size."""
    weak_sign: float = 0.05
    """Probability of chance below which an effect shows some sign of itself; it is excluded below `least_size` only."""
    most_confidence: float = 0.97
    """Nothing is stated with more: so many of the names given on blind campaigns with visible effects were right."""
    even_odds_curve: float = 30.0
    """Log odds of unseen blocks at which a curve is as often wrong in channel or variable as right: on blind campaigns
    the wrong ones came to 19, 19 and 35, the right ones to 31 and more. The best one that is not stated came to 21 at
    most where nothing was missing."""
    form_share: float = 0.2
    """A curve in a channel of a named effect that explains less than this share of what the effect does is of its law's
    form: a drag with the exponent 2.6 left 0.10; a curve beside a false name explained 0.51 of what the name did."""
    even_form: float = 0.03
    """Share of what a named effect does at which a curve of the same physics is as likely another form as a matter of
    time stamps: rotor drag and quadratic drag that stood in for a linear one left 0.051."""
    even_reduction: float = 6.0
    """Reduction of the cost of judging flights, over its dispersion, at which a name is as likely wrong as right. False
    ones came to 17, 24 and 464, of 47; of the 29 names that it was chosen on four right ones came to 8, 19, 21, 55."""
    least_confidence_curve: float = 0.3
    """A curve that would be stated with less is not stated."""
    beside_curve: float = 0.5
    """No name is stated with more beside a curve: the law that the curve is of may show in other channels as well, and
    a known effect fits a part of it. On campaigns with laws of another form 3 of 6 names beside a curve were right."""
    competing: float = 0.5
    """Candidates that reproduce this much of each other's trace compete for the same evidence."""
    named_share: float = 0.2
    """A name stands if, with the best curve beside it, it keeps this share of its own gain."""
    clear_lead: float = 3.0
    """Log odds from which on one explanation is clearly better than another."""
    contested: float = 9.0
    """Log odds on training flights below which forms of one family are also judged by held-out flights."""
    rivals: int = 3
    """So many of the best candidates are fitted in full before one is chosen."""
    screened: float = 50.0
    """Log odds by the score test, at the best candidate's fit, beyond which a rival is not fitted: far above
    `contested`, for the test takes the cost to be quadratic. At 6 times the usual size it foretold 85 for 84, at 4
    times 71 for 56."""
    rival_share: float = 0.3
    """... if they promise at least this share of the best one's gain."""
    backward_chance: float = 1e-3
    """An addition goes when a later one has made it less significant than this."""
    confirming_odds: float = 6.0
    """Log odds by which unseen flights must prefer the model with the candidate: no name is stated that is more likely
    wrong than right (`even_reduction`)."""
    could_confirm: float = 2.0
    """Held-out flights are not asked when a true effect would not stand out of their scatter by this factor."""
    certain_odds: float = 40.0
    """Log odds of training stretches from which on held-out flights that say neither yes nor no are not asked."""
    contradicting_sigmas: float = 1.64
    """... unless they speak against the effect by so many standard deviations."""
    least_blocks: int = 3
    """Fewer blocks than this have no scatter to judge a difference by."""
    unjudged_confidence: float = 0.5
    """Nothing is named with more when flights were held out and are too short to judge by."""
    even_confidence: float = 0.5
    """Nothing is stated with more while the model leaves more unexplained than any gust would, no curve while a known
    effect was not in the running or where it changed as a small name went, and a candidate that explains as much as the
    best curve with no less."""
    confounded: float = 0.9
    """Candidates that reproduce this much of another's trace are named beside it."""
    load_chance: float = 1e-3
    """Probability of chance below which it is asked whether it can be a load."""
    load_spread: float = 0.35
    """Flights of one group differ by less than this share of what lies between the groups ..."""
    load_spread_sigmas: float = 2.0
    """... and so many standard errors."""


THRESHOLDS = Thresholds()
