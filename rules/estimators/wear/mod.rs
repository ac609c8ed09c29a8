//! Tool wear from cutting power: which cuts to make, models of the power that they take, the power at which the tool is
//! worn, and the wear that a power means.
//!
//! Source: tool-wear threshold from cutting power (patent, lathe CHK460): `dPc = mu H VB s vc`, a second-order response
//! surface over coded variables, threshold `[Pc]` at the criterion VB.
//!
//! | file | what |
//! |---|---|
//! | `orthogonal_array`, `design` | the cuts to make: L4 to L27, as a work list |
//! | `conditions`, `coding`, `term` | VB, vc, f, ap with units and ranges; coded variables; terms |
//! | `surface`, `fit_surface`, `anova` | the response surface, backward elimination, analysis of variance |
//! | `gather` | from recordings and tables to cuts |
//! | `identify`, `report` | everything learned from a set of cuts, for programs and readers |
//! | `record` | a model and what it is for: file and library |
//! | `physical` | the physical form, which extrapolates |
//! | `script_numbers` | the physical form as a script holds it |
//! | `compare` | both forms on cuts that they have not seen |
//! | `model`, `power_prediction` | either form, and what it says of a cut |
//! | `threshold` | the limit `[Pc]`, the wear from a power, observable here or not |
//! | `model_selection` | the model of a library for a cut |
//! | `work` | what an edge did in one part, against what a sharp one takes |
//! | `gaussian`, `edge_state`, `follow` | the wear of every edge, followed by a Kalman filter |
//! | `hypotheses` | what may have happened between two parts: another material, a new edge; the limit beside the filter |
//! | `operation_limit` | the limit of an operation as new edges have shown it |
//! | `prior` | what the filter believes beforehand |
//! | `outlook` | probability of passing the criterion, parts left |
//! | `live` | all of it beside the running machine |

mod anova;
mod coding;
mod compare;
mod conditions;
mod design;
mod edge_state;
mod fit_surface;
mod follow;
mod gather;
mod gaussian;
mod hypotheses;
mod identify;
mod live;
mod model;
mod model_selection;
mod operation_limit;
mod orthogonal_array;
mod outlook;
mod physical;
mod power_prediction;
mod prior;
mod record;
mod report;
mod script_numbers;
mod surface;
mod term;
mod threshold;
mod unseen_edges;
mod work;

pub use adapter_core::model_library::WearKey;
pub use adapter_core::tool_name::{edge_of, tool_of};
pub use anova::{Anova, AnovaRow};
pub use coding::{Coding, Range};
pub use compare::{FormComparison, FormErrors, compare_forms};
pub use conditions::{
    CUTTING_POWER, ConditionFactor, Cut, CutConditions, FACTORS, WEAR, cutting_speed_m_min, unit_trouble,
};
pub use design::{Alias, ExperimentDesign, FactorLevels, PlannedCut, plan_experiment};
pub use edge_state::WearNews;
pub use fit_surface::{Dropped, Order, SurfaceFit, SurfaceOptions, fit_surface};
pub use follow::WearFollower;
pub use gather::{CutColumns, GatheredCuts, gather_cuts};
pub use identify::{DesignPoint, LearnedWear, WearOptions, identify_tool_wear};
pub use live::{ModelInUse, WearEstimator};
pub use model::WearModel;
pub use model_selection::{ChosenModel, choose_model};
pub use orthogonal_array::Array;
pub use outlook::{OBSERVED_SHARE, Outlook};
pub use physical::{FittedNumber, PHYSICAL_NAMES, Physical, PhysicalFit, fit_physical};
pub use power_prediction::Predicted;
pub use record::WearRecord;
pub use script_numbers::{SHORT_FORM, SHORT_LENGTH};
pub use surface::{Surface, build_published_surface, published_over};
pub use term::{WearTerm, second_order};
pub use threshold::{
    OBSERVABLE_SHARE, Observability, POOLED_PARTS_MAX, PowerLimit, WearEstimate, compute_power_limit, estimate_wear,
};
pub use work::{CutMoment, EdgeWork, WorkKey, WorkReference};
