"""How synthetic walkers walk: what varies, what is learned, what tires and what fails.

Every figure comes from docs/reference/gait.md#dynamics (dynamics of three recorded sessions, in
units of the baseline) unless a comment beside it says otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class WalkerProfile:
    """How somebody walks. Levels, noises and sds are ratios to ``baseline_w_kg``.

    Attributes
    ----------
    baseline_w_kg
        Mean A2 of the usual walk [W/kg].
    noise, calm_noise, brief_noise
        White sd from stride to stride: with feedback, without, and in familiarization and catch
        trials, which last too short to settle (sd .096 to .116 in docs/reference/gait.md#phases).
    slow_sd, calm_slow_sd, slow_phi
        Stationary sd and lag-1 coefficient of the slow AR(1) component.
    familiarization_level, catch_level
        Mean while trying out the feedback, and while asked to walk as usual without it (S1: 1.12
        and 1.06 with few misses; the same before and after training).
    exploration_level, exploration_strides
        Mean and length of the unsuccessful search: feedback strides, familiarization included.
    trained_level, trained_gain, learning_strides
        Where ``1 - exp(-n / learning_strides)`` then leads to, if the baseline is the goal and the
        display shows ``trained_gain`` of the value. What is shown drives it: another gain or goal
        leads in proportion to another level, as the same share of hits is sought (85 % shown:
        1.50 of the baseline, 1.275 of the goal).
    plateau_sd, capacity
        Sd of that level between walkers, as a ratio to it; and the highest one that anybody
        reaches, however little is shown, in the same unit.
    unlearning, discouragement
        How fast a level that is not asked for any more is left, by how fast one is learned; and by
        which share of the way walkers give up who never hit (both assumed).
    fatigue_per_100_strides, recovery
        Decrease of the level within a trial, and the share of it that a pause restores.
    after_effect, after_effect_strides
        What remains of a learned level as soon as feedback stops, and how many strides of washout
        take it down to 1/e (S1: 1.14 in the first minute, 1.09 in the tenth).
    p_missing
        Probability that a stride has no value.
    p_bad, p_stay_bad
        Markov chain of unusable strides: probability to become one and to stay one.
    p_spike, spike_min, spike_max
        Probability that a bad stride is multiplied by a factor from this range.
    stride_s, trained_stride_s, stride_sd_s
        Stride time without and with feedback, and its sd [s].
    pace_memory, pace_shares
        Lag-1 coefficients of what stride time remembers, and the shares of its variance that they
        have; the rest is white. Together: lag-1 0.47, DFA 0.86 (recorded: 0.35 to 0.60, 0.79 to
        0.94).
    pace_coupling
        Correlation of a stride's noise with its stride time (recorded: -0.39, -0.22, +0.03).
    p_slip, slip_min, slip_max
        Probability that a foot slips, and the range of what is left of its push-off.
    """

    baseline_w_kg: float = 3.9
    noise: float = 0.12
    calm_noise: float = 0.07
    brief_noise: float = 0.09
    slow_sd: float = 0.06
    calm_slow_sd: float = 0.027
    slow_phi: float = 0.97
    familiarization_level: float = 1.16
    catch_level: float = 1.08
    exploration_level: float = 0.95
    exploration_strides: int = 140
    trained_level: float = 1.50
    trained_gain: float = 0.85
    plateau_sd: float = 0.03
    capacity: float = 1.15
    unlearning: float = 0.3
    discouragement: float = 0.3
    learning_strides: float = 100.0
    fatigue_per_100_strides: float = 0.03
    recovery: float = 1.0
    after_effect: float = 0.12
    after_effect_strides: float = 1500.0
    p_missing: float = 0.0007
    p_bad: float = 0.004
    p_stay_bad: float = 0.4
    p_spike: float = 0.5
    spike_min: float = 1.6
    spike_max: float = 2.7
    stride_s: float = 1.08
    trained_stride_s: float = 1.04
    stride_sd_s: float = 0.03
    pace_memory: tuple[float, ...] = (0.6, 0.95, 0.993)
    pace_shares: tuple[float, ...] = (0.2, 0.25, 0.15)
    pace_coupling: float = -0.2
    p_slip: float = 0.002
    slip_min: float = 0.5
    slip_max: float = 0.8


@dataclass(frozen=True, slots=True)
class FeedbackResponse:
    """How people answer a feedback type, by how they answer positive feedback.

    Attributes
    ----------
    learning
        How fast they learn.
    noise
        How much they vary from stride to stride: reward without a size is explored.
    retention
        How much of the after-effect stays.
    """

    learning: float = 1.0
    noise: float = 1.0
    retention: float = 1.0


# Assumed; only the directions are measured: binary reward is learned by exploration, with larger
# variability and retention (Wood 2024); a target that is seen is learned and kept better than
# reward or punishment (Hill 2024). docs/reference/gait.md#outcomes
ANSWERS = {
    "positive": FeedbackResponse(),
    "negative": FeedbackResponse(learning=1.2, retention=0.9),
    "binary": FeedbackResponse(learning=0.8, noise=1.2, retention=1.2),
    "explicit": FeedbackResponse(learning=1.4, noise=0.9, retention=1.1),
}

GOOD = WalkerProfile()  # learns as HEBB_03 did in session 1

# Only GOOD is fitted to recordings. The others are made up from it, to try rules and screens with.
PROFILES: dict[str, WalkerProfile] = {
    "good": GOOD,
    # For trying GARRY out: learns within minutes and then hits a goal at its baseline about six
    # times of ten, so that praise, blame and the robot are all seen.
    "demo": replace(
        GOOD, exploration_strides=60, trained_level=1.05, trained_gain=1.0, learning_strides=80.0
    ),
    # Never gets much above the usual walk, varies as in exploration, and walks slowly. Baseline:
    # HEBB_91's.
    "poor": replace(
        GOOD,
        baseline_w_kg=2.2,
        noise=0.14,
        calm_noise=0.10,
        brief_noise=0.12,
        exploration_level=0.85,
        exploration_strides=300,
        trained_level=1.0,
        learning_strides=200.0,
        catch_level=1.02,
        after_effect=0.02,
        stride_s=1.30,
        trained_stride_s=1.28,
        stride_sd_s=0.045,
    ),
    # Learns at once, then tires faster than the pauses make good (HEBB_91: 1.32, later 1.14).
    "fatiguing": replace(
        GOOD,
        baseline_w_kg=2.2,
        exploration_strides=30,
        trained_level=1.40,
        fatigue_per_100_strides=0.08,
        recovery=0.25,
    ),
    # A force plate or sensor that often fails, in long bursts.
    "dropout": replace(GOOD, p_missing=0.05, p_bad=0.02, p_stay_bad=0.7),
}
