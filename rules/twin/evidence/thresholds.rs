//! The one rule by which something is reported, and the table of its thresholds.
//!
//! Something is reported when nothing is improbable, when it lowers the error of fitted units that took no part in its
//! sizes, and when the held-out error falls. It has a name when a law makes its curve; the name stands alone when it holds
//! most of the probability and no other law makes the same curve.
//!
//! | threshold | source | cost of being wrong | noticed by |
//! |---|---|---|---|
//! | `chance_max` | one recording in a hundred with nothing missing passes the test of existence | higher: false reports; lower: silence about weak effects | recordings with nothing hidden |
//! | `nothing_max`, `nothing_sure` | one in five and one in twenty: an average over resamples has a floor, since some of them leave out what shows the effect | the same | the same |
//! | `inner_gain` | less than one deviation of a paired sum: it only refuses what does not carry over at all | higher: silence; lower: forms that fit one unit only | recordings with nothing hidden, real placebos |
//! | `predicted` | below it a loss outweighs a gain: states that were read from the recording are not asked in the test of existence, and noise that rings gained 2.0 among the fitted rows where it lost 2.2 in those held out. A few stretches bound the deviation (one of 15 s gives 1.0 at most), so 1.6 silenced two of six real recordings | higher: silence about short recordings; lower: false reports | recordings with nothing hidden, short real ones |
//! | `held_out_square` | half a percent of the error: of 761 concealed cases in which something was told, five fell by less, three with nothing hidden, none named rightly | higher: silence about effects in few rows; lower: false reports | recordings with nothing hidden |
//! | `member_loss` | a third of a deviation: chance moves a useless member by more than that half of the time | higher: true names lost beside others; lower: forms that fit one unit stay | concealed pairs |
//! | `alone` | what is told as sure is right nine times of ten by its own probability | higher: classes where one is sure; lower: sure wrong names | concealed pairs and classes |
//! | `name_share` | a tenth of a curve is noise at usual sizes, another tenth is form | higher: `unknown` for known laws; lower: names for unlisted physics | laws left out of the catalogue |
//! | `pair_more`, `pair_gain` | two laws with five columns make 12 % of a smooth curve by chance | lower: pairs of names for one unlisted law | the same |
//! | `pair_whole` | noise alone leaves 3 % of a curve in large effects only; there a second law is a level, not chance | lower: second names for a form error | drives |
//! | `of_each` | half of a curve is more than chance with five columns | lower: one name for two effects; higher: two names for one law of two channels | concealed pairs, laws of two channels |
//! | `own_share` | half a percent of the energy is what an edge force leaves of itself beside Kienzle's law with free exponent | higher: silence about edge force; lower: terms that cancel each other | an input that is measured with noise |
//! | `rival_share` | a tenth of the energy is a form error of a third of the size | higher: one of a class told as sure; lower: classes everywhere | concealed classes |
//! | `class_nats` | odds of 7 to 1 | higher: classes everywhere; lower: one of a class told as sure | concealed classes |
//! | `rival_nats` | odds of 400 to 1 for the form of the textbook, which departs by 15 %: of laws that are known to be confused, the second was the true one as often as that says | higher: classes everywhere; lower: one of a class told as sure | copper loss and load loss |
//! | `form_freedom` | a slope and a bend over speed, cut, depth, feed and time, the departures of the second stage; of 479 concealed cases 2 are then sure and wrong, with 3 none and a tenth fewer names are sure | higher: one of a class told as sure; lower: classes everywhere | friction laws and gear stages |
//! | `unknown_share` | a third of the energy without a name is more than a form error of 15 % in three directions | higher: names beside unknown physics | unlisted beside listed effects |
//! | `name_energy`, `size_noise`, `size_output` | below what a user would act on: a class 0.5 meter is wrong by as much | higher: lost small effects; lower: clutter | concealed pairs |
//! | `textbook_share` | a law whose form is wrong by a third in size brings less | lower: a state passes for the law of a recorded column; higher: a known law without parameters | laws left out of the catalogue |
//! | `kept_share` | the contract; of names that kept less 10 of 13 were right, of those that kept more 57 of 59 | lower: sure names of laws that are something else; higher: `unknown` beside right names whose law is stiff | written models of concealed cases |
//! | `looked_at`, `beside` | odds of 400 and 33 to 1 | higher: long lists of names; lower: the truth missing from a class | concealed classes |

/// Every threshold of the decision; units and meaning beside each, source and cost in the table above.
pub(super) struct Thresholds {
    /// Greatest chance with which noise alone does as well, where something is reported.
    pub(super) chance_max: f64,
    /// Greatest probability of "nothing" with which something is reported.
    pub(super) nothing_max: f64,
    /// The same with which a name may be sure.
    pub(super) nothing_sure: f64,
    /// Least paired deviation (mean over deviation of the mean, by stretches of 15 s) by which what is reported lowers the
    /// error in inner parts of the fitted rows that took no part in its sizes.
    pub(super) inner_gain: f64,
    /// The same of inner parts and of rows held out together, below which what is found is withdrawn.
    pub(super) predicted: f64,
    /// Share of the squared error of rows held out by which it must fall.
    pub(super) held_out_square: f64,
    /// Paired deviation below which a member of a set does not carry over to such parts, so that sets without it are tried.
    pub(super) member_loss: f64,
    /// Probability from which one name stands alone.
    pub(super) alone: f64,
    /// Share of a curve that a named law makes from which it gives it its name.
    pub(super) name_share: f64,
    /// What two laws together must make beyond that, and beyond one of them.
    pub(super) pair_more: f64,
    pub(super) pair_gain: f64,
    /// What two laws together must make where one of them would do: nearly all of the curve.
    pub(super) pair_whole: f64,
    /// Share of each of several curves that one law must make to claim them all.
    pub(super) of_each: f64,
    /// Share of its energy that the baseline must leave of what is told: less is a change of the model's own parameters.
    pub(super) own_share: f64,
    /// Share of a curve that got its name by projection that another law must make to stand beside.
    pub(super) rival_share: f64,
    /// Nats that a law may lose in the place of another and still stand beside it.
    pub(super) class_nats: f64,
    /// The same of a law that the catalogue knows it is confused with.
    pub(super) rival_nats: f64,
    /// Directions in which the law of a machine departs from that of the textbook.
    pub(super) form_freedom: f64,
    /// Share of the energy from which a nameless part makes the whole unexplained.
    pub(super) unknown_share: f64,
    /// Share of the energy below which a name is dropped.
    pub(super) name_energy: f64,
    /// Size in deviations of the ordinary noise, and as a share of the output, below which (both) a name is dropped.
    pub(super) size_noise: f64,
    pub(super) size_output: f64,
    /// Share of what a curve brings that the law of a state must bring, so that it is that state.
    pub(super) textbook_share: f64,
    /// Share of what a curve gains in rows held out that the law must gain as it is written, so that its name stands alone.
    pub(super) kept_share: f64,
    /// Nats behind the best within which a set is looked at.
    pub(super) looked_at: f64,
    /// Nats behind the best within which another name stands beside it.
    pub(super) beside: f64,
}

pub(super) const THRESHOLDS: Thresholds = Thresholds {
    chance_max: 0.01,
    nothing_max: 0.2,
    nothing_sure: 0.05,
    inner_gain: 0.8,
    predicted: 0.0,
    held_out_square: 0.01,
    member_loss: -0.3,
    alone: 0.9,
    name_share: 0.8,
    pair_more: 0.05,
    pair_gain: 0.12,
    pair_whole: 0.97,
    of_each: 0.5,
    own_share: 0.002,
    rival_share: 0.95,
    class_nats: 2.0,
    rival_nats: 6.0,
    form_freedom: 10.0,
    unknown_share: 0.35,
    name_energy: 0.02,
    size_noise: 0.3,
    size_output: 0.005,
    textbook_share: 0.6,
    kept_share: 0.8,
    looked_at: 6.0,
    beside: 3.5,
};
