"""What a verdict asks for: every threshold of the tracing, in one object, with its reason beside.

Set on development flights only (`benchmarks/README.md` says which), and then left alone: other seeds and foreign worlds judge them.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Criteria:
    """Deviances are -2 log likelihoods, everything that is not known integrated out; a difference of 10 is a likelihood ratio of 150."""

    # does the null model stand?
    worse_than_identified: float = 1.25
    """Times the identified model's error on validation loops that the null model may reach: beyond it, it is another model."""
    follows: float = 2.0
    """Chi-square per degree of freedom on validation loops that the null model may reach with the help of its model error: beyond it, it
    does not follow the flight whatever helps, and its likelihood means nothing."""
    near: float = 1000.0
    """The same without that help, beyond which it is nowhere near the flight: of all flights of the campaigns on which an effect was found
    (0.1.0's aside) none had left more than 11, a form that the library does not have 25; a rudder logged with the wrong sign 510, which
    the search leads to the rudder. (UMN's Thor: 3600.)"""
    lost_share: float = 0.1
    """Share of segments that may diverge under the null model."""

    # is a candidate significant?
    family_error: float = 0.01
    """Probability that any candidate of an empty library would pass (Holm 1979)."""
    decisive: float = 10.0
    """Deviance by which a model must lead another one: a likelihood ratio of 150, "very strong" (Kass & Raftery, JASA 90, 1995)."""
    approximate: float = 0.03
    """Share of what an effect gains by which it must lead another one, where that is more than `decisive`: models are approximate, and what
    they gain is known no better. In JSBSim a constant wind gained 1.7 % more than the power law over height that had blown."""
    form: float = 0.1
    """Share of what an accepted effect has gained that a further name must gain: an effect whose form is not quite the one that is there
    leaves a few per cent of what it gains. A pitch moment with the cube of alpha, told by its square, left 3 to 7 % to a stall; second
    effects that were there gained 19 % and more (development flights)."""
    known_form: float = 0.02
    """The same, in calm air, beside an effect of the line or of what an instrument reports: a bias is a bias, and a string obeys Hooke. It
    may gain many times what another effect does: beside a winch clock 1 s late a constant wind got no name (tracing campaign, family 52).
    Not in gusts: there a rudder that answers them seemed late beside a late position (JSBSim, family 48)."""
    per_parameter: float = 2.0
    """Deviance that each strength costs beside (Akaike)."""

    in_one_flight: float = 30.0
    """Deviance that a candidate must promise in one of several flights, where all together show nothing, to be told: three times what is
    decisive, for nothing is fitted. A pitot 6 % low in one of two promises twice that (`tests/tracing/test_shown_alone.py`)."""

    # is it what is missing?
    floor_error: float = 0.02
    """Relative error of the noise floor: a chi-square per degree of freedom within 1 +- this is at the floor, for noise is known no better
    ..."""
    channel_error: float = 0.1
    """... the same of one channel, of which there is less ..."""
    sampling: float = 2.0
    """... and beside that as many standard deviations, sqrt(2 / n) for n samples, as a maximum over channels takes by chance."""
    rest_worth: float = 20.0
    """Deviance that model error must be worth for something to be missing: `decisive`, for each of force and moment."""

    steady: float = 1e-4
    """Probability with which chance would make an effect's size drift so much through a flight: below, no one size is what is there. True
    effects of the development flights come to 0.1 and more, sensors that drift in JSBSim to 2e-7 and less."""
    constant: float = 100.0
    """Deviance that an effect's size may gain by going with a channel of the flight: more, and it is another effect that does. True effects
    in JSBSim come to 15, one of the right name and another form (an error of the pitot linear in sideslip, fitted by its square) to 70, a
    gyro that feels acceleration, which was called a bias, to 2170."""

    at_bound: float = 4.0
    """Cost (chi-square) that a candidate must gain which brings a parameter back from its bound: a bound lies two standard deviations from
    the declared value where nothing else is said, and that is what the prior alone pays for the way back."""
    collinear: float = 0.95
    """Cosine between a candidate and a parameter beyond which one hides in the other."""
    empirical: float = 10.0
    """Deviance by which as few or fewer empirical terms must lead an answer of the library to take its place: `decisive`."""

    # how likely is it?
    temperature: float = 5.0
    """By which differences of deviance are divided before they become odds: both models are approximate, and evidence between approximate
    models is overconfident (Grunwald & van Ommen, Bayesian Analysis 12, 2017). How well it is chosen, no campaign has shown yet."""
    unknown: float = 0.02
    """Probability that is kept for something else in any case: libraries are not complete."""

    much: float = 10.0
    """Times the floor's error by which a chi-square may exceed 1: beyond, something is left, however little model error can take of it."""
    rest_slight: float = 60.0
    """Deviance up to which model error may be worth something and yet be too little to be called missing, where chi-square is at the floor:
    a likelihood is no better than its noise, whose colour and level are known to a few per cent."""

    # are the sensors what they can be?
    drift_spreads: float = 2.0
    """Spreads of its prior (in logarithms) by which a sensor's drift may exceed what is usual: beyond, it is no drift of a sensor ..."""
    noise_factor: float = 3.0
    """... nor is white noise that is so many times the declared one noise."""

    # does the rest repeat?
    repeats: float = 0.01
    """Probability with which chance would make the smoothed model error repeat as much from loop to loop (permutation of the phase), or
    go on as much from one loop to the next (permutation of the loops)."""
    repeated_share: float = 0.2
    """Least share of its variance that repeats or goes on, for a part that is said to."""

    drift_step: float = 10.0
    """Times its usual change from one loop to the next by which the drift of a sensor may step: beyond, the sensor has changed. A drift
    that wanders comes to 6 at most, sensors that change in flight to more than this (`tests/tracing/test_sensors_that_change.py`)."""

    # which air is gusty?
    gusty: float = 0.2
    """[m/s] level of gusts from which on the air is called gusty: what 0.2 m/s do to tension is its 1 % noise."""

    clear_of_gusts: float = 150.0
    """Deviance from which an effect of a surface that answers the kite (`tracing.feedback`) need not predict better by `predicts`, too, in
    gusty air: less, a controller that answers gusts may make of it (`tracing.answered_gusts`); and that a further effect must gain there.
    In JSBSim's turbulence a rudder that answers what gusts do seemed 28 ms late, worth 59, and another one 53 ms, worth 107; effects that
    were there and predicted no better by a tenth come to 250 and more."""
    in_gusts: float = 30.0
    """The same of any other effect, alone and beside the effect of a surface that gains most. On the silent flights of JSBSim's families 38
    to 42, on which this was set (traced by a852cd1), what is not there gains 6, and once 29, but 18 beside a rudder's lag; what is there
    gains 32 to 120."""
    predicts_little: float = 0.02
    """Share of the prediction error on validation loops that what gains more than `in_gusts` must take away in gusty air, up to
    `clear_of_gusts`. In JSBSim's family 48 a stall took the place of a rudder that is rigged beside neutral: it gained more than
    `in_gusts`, and predicted as before. Set on that flight and four of families 47 and 48 whose true effect gained as little."""
    beyond_gusts: float = 1000.0
    """Deviance from which an effect of such a surface is not asked what it would gain were it not there (`tracing.bootstrap`): five times
    what that has come to. What gains less must gain by as much more than that as another effect gains in gusts: by `in_gusts`
    as the square of the difference of their roots, over 2. Set on two lags that were not there (JSBSim, family 47: less, with any gusts)
    and three that were (families 44 to 46: twice as much and more)."""

    # where no verdict is possible, what predicts better?
    predicts: float = 0.1
    """Share of the prediction error on validation loops, and of their chi-square, that an effect must take away to be told as what the
    model predicts better with. On the measured flights that rules were set on, one effect takes 15 %, all others 4 % and less."""
    nowhere: float = 25.0
    """Chi-square per degree of freedom on validation loops of the declared model fitted by output error, beyond which nothing is told: five
    standard deviations off on average, it is no model of the flight. (A rudder of the wrong sign leaves 52.)"""

    # how much is tried?
    competitors: int = 5
    """Candidates that are fitted in a round ..."""
    close: float = 0.3
    """... and those whose predicted gain is at least this share of the largest, up to twice as many."""
    alike: float = 0.9
    """Correlation of what two candidates would do from which on one is fitted where the other is."""
    look_alike: float = 40.0
    """Deviance that another effect in the place of an accepted one may leave, to first order, and still be fitted there."""
    detectable: float = 3.5
    """Standard deviations from which on a strength is detectable: what the family error leaves of some thirty candidates."""
    finalists: float = 30.0
    """Deviance within which of the best a candidate is fitted to the end."""
    effects: int = 3
    """At most so many effects are accepted one after the other."""

    def lead(self, gain: float) -> float:
        """Deviance by which an effect that gains so much must lead another one."""
        return max(self.decisive, self.approximate * gain)

    def in_reach(self, least: float, gain: float) -> float:
        """Deviance by which another one may fall behind before it is fitted to the end: twice that lead, and at least `least`."""
        return max(least, 2 * self.lead(gain))


CRITERIA = Criteria()
