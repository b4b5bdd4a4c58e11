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
    trained_level, learning_strides
        What ``1 - exp(-n / learning_strides)`` then leads up to.
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
    """

    baseline_w_kg: float = 3.9
    noise: float = 0.12
    calm_noise: float = 0.07
    brief_noise: float = 0.09
    slow_sd: float = 0.06
    calm_slow_sd: float = 0.027
    slow_phi: float = 0.97
    familiarization_level: float = 1.145
    catch_level: float = 1.08
    exploration_level: float = 0.95
    exploration_strides: int = 150
    trained_level: float = 1.50
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


GOOD = WalkerProfile()  # learns as HEBB_03 did in session 1

# Only GOOD is fitted to recordings. The others are made up from it, to try rules and screens with.
PROFILES: dict[str, WalkerProfile] = {
    "good": GOOD,
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
