//! The parts of the job: each learned from the history and the annotations, or why not and what to do next.

use super::columns::{self, Merged};
use super::picture::{Dot, Picture};
use super::torque_file::TorqueFileError;
use crate::identification::{self, THERMAL, TOOL_WEAR};
use gateway_history::STATE_SERIES;
use recording::{Cells, Numbers, Recording};
use rules::estimators::power_separation::{
    LoadLossLearned, NoLoadLearned, ReferenceChoice, identify_load_loss, identify_no_load,
};
use rules::estimators::regression::{Refusal, RefusalKind};
use rules::estimators::thermal::{SelectionSettings, ThermalModel, collect_rows, learn_law};
use rules::estimators::wear::{
    Cut, CutColumns, LearnedWear, WearKey, WearOptions, WearRecord, gather_cuts, identify_tool_wear,
};
use serde_json::Value;

/// One part of the job.
#[derive(Debug, Clone, PartialEq)]
pub struct JobPart {
    /// The word of the part in the report and in JSON, as in `no-load`.
    pub name: &'static str,
    /// What is known, or why not.
    pub known: Result<String, Refusal>,
    /// What to do next, and why; empty where nothing is missing.
    pub next: String,
    /// How long that takes, minutes.
    pub minutes: f64,
}

/// Everything that history and annotations tell.
pub struct Learned {
    /// The parts, in the order in which to do them.
    pub parts: Vec<JobPart>,
    /// No-load powers, where learned.
    pub no_load: Option<NoLoadLearned>,
    /// Load loss, where learned.
    pub load_loss: Option<LoadLossLearned>,
    /// The wear model, where learned.
    pub wear: Option<WearRecord>,
    /// The thermal law, where learned.
    pub thermal: Option<ThermalModel>,
    /// What the page draws of each fit that succeeded.
    pub pictures: Vec<Picture>,
    /// How the models were found, by subject: what the page of the box shows.
    pub found: Vec<(&'static str, Value)>,
    /// What became of torque files.
    pub merged: Vec<Merged>,
}

/// Learns what can be learned from a recording that holds the annotated columns.
#[must_use]
pub fn learn_parts(recording: &Recording, merged: Vec<Merged>, machine: &str, criterion_mm: f64) -> Learned {
    let mut learned = Learned {
        parts: Vec::new(),
        no_load: None,
        load_loss: None,
        wear: None,
        thermal: None,
        pictures: Vec::new(),
        found: Vec::new(),
        merged,
    };
    learned.no_load(recording);
    learned.load_loss(recording);
    learned.learn_wear(recording, machine, criterion_mm);
    learned.learn_thermal(recording, machine);
    learned
}

impl Learned {
    fn add_part(&mut self, name: &'static str, known: Result<String, Refusal>, next: &str, minutes: f64) {
        let (next, minutes) = if known.is_ok() { (String::new(), 0.0) } else { (next.to_owned(), minutes) };
        self.parts.push(JobPart { name, known, next, minutes });
    }

    fn no_load(&mut self, recording: &Recording) {
        let found = identify_no_load(recording);
        let known = found.as_ref().map_err(Clone::clone).and_then(|learned| {
            let speeds = learned.speeds.len();
            if speeds < 4 {
                let what =
                    format!("only {speeds} speeds are known; between fewer than 4 the interpolation cannot be checked");
                return Err(Refusal::new(RefusalKind::TooFew, what, "let the spindle turn at more speeds"));
            }
            Ok(format!("{speeds} speeds, {} visits", learned.stretches.len()))
        });
        self.add_part(
            "no-load",
            known,
            "let the spindle turn without feed at 4 speeds or more of every gear stage, 30 s each, after a warm-up: everything else is \
             measured against these powers. `commission --plan no-load` writes the list",
            6.0,
        );
        let Ok(learned) = found else { return };
        let dots = learned.speeds.iter().map(|it| Dot {
            x: it.speed_rpm,
            y: it.power_w,
            sd: 0.5 * (it.interval_w.1 - it.interval_w.0),
        });
        self.pictures.push(Picture::new_curve("No-load power 空载功率", "rpm", "W", dots.collect()));
        self.no_load = Some(learned);
    }

    fn load_loss(&mut self, recording: &Recording) {
        let found = identify_load_loss(recording, &ReferenceChoice::default());
        let known = found.as_ref().map(|learned| {
            let each = learned.stages.iter().map(|stage| {
                let accuracy =
                    stage.accuracy.as_ref().map_or_else(String::new, |it| format!(", E {:.2} %", 100.0 * it.mean));
                let speed =
                    stage.speed_rpm.map_or_else(String::new, |rpm| format!(" at {rpm:.0} rpm, elsewhere with 1/n^2"));
                format!(
                    "stage {}: a0 {:.4}, a1 {:.2e} 1/W{speed}{accuracy}",
                    stage.stage, stage.linear.value, stage.quadratic_per_w.value
                )
            });
            each.collect::<Vec<String>>().join("; ")
        });
        self.add_part(
            "load-loss",
            known.map_err(Clone::clone),
            "mount a torque sensor at the spindle for this one run, cut four depths at each of three speeds with idling between, then give its file: \
             `annotate torque --file sensor.csv --unit Nm`. Without it cutting power is off by what the drive loses under load, 10 to 25 %, \
             and how the loss goes with the speed is told by slow and fast cuts only. `commission --plan load-loss` writes the list",
            9.0,
        );
        let Ok(learned) = found else { return };
        let groups = learned.stages.iter().filter_map(|stage| stage.accuracy.as_ref()).flat_map(|it| &it.groups);
        let dots = groups.map(|it| Dot { x: it.measured_w, y: it.estimated_w, sd: 0.0 }).collect();
        self.pictures.push(Picture::new_agreement("Cutting power: sensor and estimate 切削功率", "W", dots));
        self.load_loss = Some(learned);
    }

    fn learn_wear(&mut self, recording: &Recording, machine: &str, criterion_mm: f64) {
        let separated = self.separate_power(recording).map_err(WearLack::of_all);
        let found = separated.and_then(|recording| wear_of(&recording, criterion_mm));
        let known = found.as_ref().map(|learned| {
            format!("{} cuts, {} form, R2 {:.1} %", learned.cuts.len(), learned.model.form(), 100.0 * learned.r2)
        });
        let known = known.map_err(|lack| lack.refusal.clone());
        let (next, minutes) = found.as_ref().err().map_or((String::new(), 0.0), WearLack::next);
        self.add_part("wear", known, &next, minutes);
        let Ok(learned) = found else { return };
        self.found.push((TOOL_WEAR, learned.to_json()));
        let predicted = |cut: &Cut| learned.model.predict_power(&cut.conditions).power_w;
        let dots = learned.cuts.iter().map(|cut| Dot { x: cut.cutting_power_w, y: predicted(cut), sd: 0.0 });
        self.pictures.push(Picture::new_agreement("Cutting power of the wear model 磨损模型", "W", dots.collect()));
        let key = WearKey {
            machine: machine.to_owned(),
            tool: String::new(),
            work_material: String::new(),
            operation: String::new(),
        };
        let origin = ("commission".to_owned(), learned.cuts.len(), learned.r2);
        self.wear = Some(WearRecord::new(key, learned.criterion_mm, origin, learned.model));
    }

    /// The recording with cutting power separated by the coefficients that were just learned.
    fn separate_power(&self, recording: &Recording) -> Result<Recording, Refusal> {
        let loss = self.load_loss.as_ref().ok_or_else(|| {
            Refusal::new(
                RefusalKind::Missing,
                "load loss is not known yet",
                "do load-loss first: wear is seen in cutting power",
            )
        })?;
        let mut recording = recording.clone();
        if recording.find_numbers("flank_wear_mm").is_none() {
            let what = "no flank wear has been annotated";
            return Err(Refusal::new(
                RefusalKind::Missing,
                what,
                "annotate flank-wear 0.05 --unit mm --at now --of EDGE",
            ));
        }
        let column = |name: &str, row: usize| recording.find_numbers(name).and_then(|it| it.get(row));
        let inner = inner_rows(&recording);
        let one = |row: usize| {
            let excess_w = column("spindle_power_w", row)? - column("no_load_power_w", row)?;
            let stage = column("gear_stage", row).unwrap_or(0.0);
            let own = loss.stages.iter().find(|it| (it.stage as f64 - stage).abs() < 0.5).or(loss.stages.first())?;
            let split = own.load_loss().split_excess_power(excess_w, column("spindle_speed_rpm", row)?)?;
            inner[row].then_some(split.cutting_power_w)
        };
        let cutting = (0..recording.count_rows()).map(one).collect::<Numbers>();
        recording.set_column("cutting_power_w", Cells::Numbers(cutting));
        Ok(recording)
    }

    fn learn_thermal(&mut self, recording: &Recording, machine: &str) {
        let found = collect_rows(recording).and_then(|collected| {
            let learned = learn_law(&collected.course, SelectionSettings::default(), None)?;
            Ok((learned, collected.left_out))
        });
        let known = found.as_ref().map(|(learned, _)| {
            let best = learned.best_candidate();
            format!("{} terms, {:.2} um in blocks left out", best.fit.law.terms.len(), best.held_out.rms_um)
        });
        self.add_part(
            "thermal",
            known.map_err(Clone::clone),
            "warm the machine up and let it cool, twice, and read the error every few minutes with a gauge or a probe: \
             `annotate gauge 14 --unit um --at now`; a channel thermal_error_um does it by itself. Only for whoever wants the thermal \
             error predicted",
            180.0,
        );
        let Ok((learned, left_out)) = found else { return };
        self.found.push((THERMAL, identification::of_thermal(&learned, &left_out)));
        self.thermal = Some(ThermalModel::new(machine.to_owned(), learned.best_candidate().fit.law.clone()));
    }
}

/// Left out after a cut begins and before it ends, s: the meter's window, the filter and the entry of the tool.
const GUARD_S: f64 = 1.0;

/// Which rows lie inside a cut, away from its ends.
fn inner_rows(recording: &Recording) -> Vec<bool> {
    let states = recording.find_words(STATE_SERIES);
    let cutting = |row: usize| states.and_then(|words| words.get(row)) == Some("cutting");
    let mut inner = vec![false; recording.count_rows()];
    let mut begin = 0;
    while begin < inner.len() {
        let end = (begin..inner.len()).find(|row| !cutting(*row)).unwrap_or(inner.len());
        if end > begin {
            let (from_s, to_s) = (recording.time_s[begin] + GUARD_S, recording.time_s[end - 1] - GUARD_S);
            let of_the_cut = inner.iter_mut().zip(&recording.time_s).skip(begin).take(end - begin);
            of_the_cut.for_each(|(inner, time_s)| *inner = (from_s..=to_s).contains(time_s));
        }
        begin = end + 1;
    }
    inner
}

/// Minutes that one list of nine cuts takes, with a look through the microscope before and after.
const LIST_MINUTES: f64 = 8.3;

/// Why there is no wear model, and which of the three lists would bring it.
struct WearLack {
    refusal: Refusal,
    /// Lists that are there already: they are not made again.
    made: usize,
    /// Flank wear of the most worn edge, where it is less than the criterion.
    most_mm: Option<f64>,
}

impl WearLack {
    fn of_all(refusal: Refusal) -> Self {
        Self { refusal, made: 0, most_mm: None }
    }

    /// What to do next, and how many minutes it takes.
    fn next(&self) -> (String, f64) {
        let lists = ["`wear-1`, a new edge", "`wear-2`, a half worn edge", "`wear-3`, an edge worn past the criterion"];
        let missing = lists.get(self.made..).unwrap_or_default();
        if missing.is_empty() {
            return (self.refusal.next.clone(), LIST_MINUTES);
        }
        let minutes = LIST_MINUTES * missing.len() as f64;
        let other_way = self.most_mm.map_or_else(String::new, |most_mm| {
            let lower_mm = (100.0 * most_mm).floor() / 100.0;
            format!(
                ". Where no edge is used so long, `--criterion-mm {lower_mm}` lets an edge count as worn there, and no cut is \
                 missing"
            )
        });
        let text = format!(
            "make {} cuts of the L27 list, nine with each edge: {}; read the flank wear of each under the microscope before and \
             after and give it: `annotate flank-wear 0.05 --unit mm --at now --of EDGE`. `commission --plan` writes each \
             list{other_way}",
            9 * missing.len(),
            missing.join("; ")
        );
        (text, minutes)
    }
}

fn wear_of(recording: &Recording, criterion_mm: f64) -> Result<LearnedWear, WearLack> {
    let gathered = gather_cuts(recording, &CutColumns::default()).map_err(WearLack::of_all)?;
    let levels = wear_levels(&gathered.cuts);
    if gathered.cuts.len() < 20 || levels < 3 {
        let what = format!("{} cuts at {levels} wears are known; the list has 27 at 3", gathered.cuts.len());
        let refusal = Refusal::new(RefusalKind::TooFew, what, "go on with the list");
        let made = levels.min(gathered.cuts.len() / 9).min(2);
        return Err(WearLack { refusal, made, most_mm: None });
    }
    let most_mm = gathered.cuts.iter().map(|cut| cut.conditions.to_vector()[0]).fold(0.0, f64::max);
    if most_mm < criterion_mm {
        let what = format!(
            "the most worn edge had {most_mm:.3} mm, an edge counts as worn at {criterion_mm} mm: the limit would lie outside the model"
        );
        let next = "make wear-3 with an edge that is worn past the criterion, or give a lower --criterion-mm";
        let refusal = Refusal::new(RefusalKind::OutOfRange, what, next);
        return Err(WearLack { refusal, made: 2, most_mm: Some(most_mm) });
    }
    identify_tool_wear(gathered.cuts, &WearOptions { criterion_mm, ..WearOptions::default() })
        .map_err(|refusal| WearLack { refusal, made: 3, most_mm: None })
}

/// Wears that lie apart by more than 0.03 mm: what a microscope in the shop tells apart for certain.
fn wear_levels(cuts: &[Cut]) -> usize {
    let mut wears: Vec<f64> = cuts.iter().map(|cut| cut.conditions.to_vector()[0]).collect();
    wears.sort_by(f64::total_cmp);
    usize::from(!wears.is_empty()) + wears.windows(2).filter(|pair| pair[1] - pair[0] > 0.03).count()
}

/// Why the history cannot be prepared for the identification.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// It cannot be read.
    #[error(transparent)]
    History(#[from] gateway_history::HistoryError),
    /// A torque file can no longer be read.
    #[error(transparent)]
    TorqueFile(#[from] TorqueFileError),
}

/// The history with everything annotated.
///
/// # Errors
/// What cannot be read.
pub fn prepare_recording(
    history: &std::path::Path,
    annotations: &[super::annotations::Annotation],
    from_ns: Option<i64>,
) -> Result<(Recording, Vec<Merged>), PrepareError> {
    let mut recording = columns::read(history, from_ns)?;
    columns::add_wear(&mut recording, annotations);
    columns::add_thermal_error(&mut recording, annotations);
    let merged = columns::add_torque(&mut recording, annotations)?;
    Ok((recording, merged))
}
