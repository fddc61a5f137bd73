//! A window with a solver behind it: the solution gets better while one walks through it.
//!
//! One thread solves, in a rayon pool of its own, so that the window never waits for it. It first shows what the scene
//! looks like with hardly any light transport, then a sketch of a solution, then the one asked for; what the user wants
//! meanwhile it learns between two steps of the solver. Edits of materials are followed over the links of what was solved last, and
//! every solution is then solved for anew: the old one stays in the window until then.

use crate::args::Args;
use crate::camera_path::CameraPath;
use crate::error::ViewError;
use crate::glossy::Mode;
use crate::interrupt::{Interrupt, STOPPING};
use crate::loading::load;
use crate::progress::{Progress, activity};
use crate::raycast::Spared;
use crate::solution_file;
use crate::solved::{Accuracy, Editable, Purpose, Solved, Wanted};
use crate::stats::{self, Times};
use crate::walkthrough::Walkthrough;
use crate::watched::Watched;
use crate::window::{self, Screen, Status, WindowOptions, Wish};
use hr_diffuse::{Budget, Phase, Settings, SolveError};
use hr_scene::edits::{brightened, roughened};
use hr_scene::{Material, Rgb, Scene};
use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Before the solution asked for there is one with this many times its error: a small part of the work, and soon there.
const COARSER: f32 = 4.0;
/// The errors that can be asked for.
const FINEST: f32 = 0.001;
const COARSEST: f32 = 1.0;
/// How often the scene's file is looked at.
const LOOK: Duration = Duration::from_millis(700);
/// The window is told of progress no more often than this.
const TELL: Duration = Duration::from_millis(500);

/// Opens a window and solves for what is seen in it, until it is closed. Then statistics and solution are written, if
/// that is asked for and was not done before: they are as soon as the accuracy asked for is reached.
pub(crate) fn window(args: &Args, path: &CameraPath, progress: &Arc<Progress>) -> Result<(), ViewError> {
    let (wishes, heard) = channel();
    let results = Arc::new(Mutex::new(Results::default()));
    let options = WindowOptions {
        name: args.scene.clone(),
        path: path.clone(),
        path_file: args.path.clone(),
        wishes: Some(wishes),
        ..WindowOptions::default()
    };
    let (solver_args, solver_progress) = (args.clone(), Arc::clone(progress));
    let solver_results = Arc::clone(&results);
    window::open_live(&options, move |screen| {
        let session = Session::new(solver_args, solver_progress, screen, heard, solver_results);
        std::thread::spawn(|| session.run());
    })?;
    // Not before the solver's thread has written what it is writing.
    let mut results = results.lock().unwrap_or_else(PoisonError::into_inner);
    results.write(args)?;
    results.failure.take().map_or(Ok(()), Err)
}

/// What is left when the window is closed.
#[derive(Default)]
struct Results {
    /// The best solution so far, and the times that it took.
    best: Option<(Arc<Solved>, Accuracy, Times)>,
    written: bool,
    /// Why there is nothing to show.
    failure: Option<ViewError>,
}

impl Results {
    /// Writes what is asked for, unless that was done.
    fn write(&mut self, args: &Args) -> Result<(), ViewError> {
        let Some((solved, accuracy, times)) = self.best.as_ref().filter(|_| !self.written) else { return Ok(()) };
        self.written = true;
        if let Some(path) = &args.save {
            solution_file::save(path, solved, *accuracy)?;
        }
        if let Some(path) = &args.stats {
            stats::write(path, solved, *accuracy, times, Spared::default())?;
        }
        Ok(())
    }
}

/// Something to do.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Task {
    /// Read the scene and begin.
    Load,
    /// Show it with what light there is at once.
    Glance,
    /// Solve to an error and show it soon: without directional light that no link asks for, and with values at vertices
    /// as exact as there is patience for. Both may take longer than all the rest.
    Sketch(f32),
    /// Let the light of what was solved last follow an edit.
    Follow,
    /// Solve to an error; shown if it is better than what is shown, or in any case.
    Solve { error: f32, in_any_case: bool },
}

/// The thread that solves.
struct Session {
    args: Args,
    progress: Arc<Progress>,
    screen: Screen,
    wishes: Receiver<Wish>,
    results: Arc<Mutex<Results>>,
    /// While it solves; else Ctrl-C ends the program.
    interrupt: Option<Interrupt>,
    watched: Watched,
    looked: Instant,
    scene: Option<Arc<Scene>>,
    /// What the solution to come goes on from.
    begun: Option<(Solved, Accuracy)>,
    /// What takes over edits.
    editable: Option<Editable>,
    /// Whether it is no longer what the file says; then it is not kept.
    is_edited: bool,
    /// Whether there is something in the window.
    has_shown: bool,
    /// Seconds that loading took.
    loaded: f64,
    tasks: VecDeque<Task>,
    status: Status,
    told: Instant,
    /// What is wanted of the solution that is being made.
    wanted: Wanted,
}

impl Session {
    fn new(
        args: Args,
        progress: Arc<Progress>,
        screen: Screen,
        wishes: Receiver<Wish>,
        results: Arc<Mutex<Results>>,
    ) -> Self {
        let now = Instant::now();
        Self {
            watched: Watched::new(args.scene.clone().into()),
            status: Status { asked: args.error, ..Status::default() },
            interrupt: None,
            looked: now,
            told: now,
            scene: None,
            begun: None,
            editable: None,
            is_edited: false,
            has_shown: false,
            loaded: 0.0,
            tasks: VecDeque::from([Task::Load]),
            wanted: Wanted::Whole,
            args,
            progress,
            screen,
            wishes,
            results,
        }
    }

    /// Does what there is to do until the window is closed.
    fn run(mut self) {
        let threads = self.args.threads.unwrap_or(0);
        let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(threads).start_handler(step_back).build() else {
            return self.fail(ViewError::Arguments("no threads can be started; ask for fewer with --threads".into()));
        };
        loop {
            while let Some(task) = self.tasks.pop_front() {
                if let Err(error) = pool.install(|| self.perform(task)) {
                    if !self.has_shown {
                        return self.fail(error);
                    }
                    self.tasks.clear();
                    self.screen.say(error.to_string());
                }
            }
            self.write();
            self.status.activity = None;
            self.screen.status(self.status.clone());
            self.progress.clear();
            if !self.wait() {
                return;
            }
        }
    }

    /// Ends the program: there is nothing to look at.
    fn fail(self, error: ViewError) {
        self.results.lock().unwrap_or_else(PoisonError::into_inner).failure = Some(error);
        self.screen.close();
    }

    /// Writes statistics and solution. Where that fails one may still look at it; the program's end tells.
    fn write(&self) {
        let mut results = self.results.lock().unwrap_or_else(PoisonError::into_inner);
        if let Err(error) = results.write(&self.args) {
            self.screen.say(error.to_string());
            results.failure = Some(error);
        }
    }

    /// Waits for something to do; false where the window has been closed.
    fn wait(&mut self) -> bool {
        while self.tasks.is_empty() {
            match self.wishes.recv_timeout(LOOK) {
                Ok(wish) => self.hear(wish),
                Err(RecvTimeoutError::Timeout) => self.look(),
                Err(RecvTimeoutError::Disconnected) => return false,
            }
        }
        true
    }

    fn perform(&mut self, task: Task) -> Result<(), ViewError> {
        self.wanted = Wanted::Whole;
        match task {
            Task::Load => self.load(),
            Task::Glance => self.solve(COARSEST, Some(Duration::ZERO), true, true),
            Task::Sketch(error) => match self.time_left() {
                // Where the time is up already, what there is has to do.
                Some(Duration::ZERO) => Ok(()),
                left => self.solve(error, left, false, true),
            },
            Task::Follow => self.follow(),
            Task::Solve { error, in_any_case } => match if in_any_case { None } else { self.time_left() } {
                Some(Duration::ZERO) => Ok(()),
                left => self.solve(error, left, in_any_case, false),
            },
        }
    }

    /// What is left of the time that the command line gives.
    fn time_left(&self) -> Option<Duration> {
        self.args.time_budget.map(|budget| Duration::from_secs_f64(budget).saturating_sub(self.progress.elapsed()))
    }

    fn load(&mut self) -> Result<(), ViewError> {
        self.begin(&format!("loading {}", self.args.scene));
        let begin = Instant::now();
        let scene = load(&self.args, &self.progress)?;
        self.loaded = begin.elapsed().as_secs_f64();
        self.scene = Some(Arc::clone(&scene));
        (self.is_edited, self.editable) = (false, None);
        if let Some(path) = &self.args.load {
            let (solved, accuracy) = solution_file::load(path, scene)?;
            self.status.asked = accuracy.asked;
            return self.show(solved, accuracy);
        }
        if let Some(path) = &self.args.resume {
            self.begun = Some(solution_file::load(path, scene)?);
            self.tasks.push_back(Task::Solve { error: self.status.asked, in_any_case: false });
            return Ok(());
        }
        self.tasks.push_back(Task::Glance);
        let coarse = self.status.asked * COARSER;
        if coarse <= COARSEST {
            self.tasks.push_back(Task::Sketch(coarse));
        }
        self.tasks.push_back(Task::Solve { error: self.status.asked, in_any_case: false });
        Ok(())
    }

    /// Solves and shows the result, if it is worth showing.
    fn solve(
        &mut self,
        error: f32,
        time: Option<Duration>,
        in_any_case: bool,
        is_sketch: bool,
    ) -> Result<(), ViewError> {
        let Some(scene) = self.scene.clone() else { return Ok(()) };
        self.begin("building the hierarchy");
        let is_glance = time == Some(Duration::ZERO);
        let budget = Budget { time, ..Budget::default() };
        let settings = Settings { error, budget, transport: self.args.transport };
        // Mirrors are shown by their distributions in any mode; what is kept is for every mode.
        let mirrors = || scene.materials.iter().any(|material| material.reflector.mirror() != Rgb::ZERO);
        let wants_distributions = self.mode() == Mode::Distributions || self.args.save.is_some() || mirrors();
        let (begun, mut editable) = (self.begun.take(), None);
        self.interrupt = Some(Interrupt::listen());
        let ask = &mut |state: &hr_diffuse::Progress| match self.attend(state) {
            Wanted::Whole if is_sketch && state.phase == Phase::Reconstruct => Wanted::Now,
            wanted => wanted,
        };
        let distributions = wants_distributions && !is_sketch;
        let purpose = Purpose { distributions, cameras: None };
        let found = match begun {
            Some((solved, accuracy)) => solved.resumed(settings, purpose, accuracy, ask),
            None if is_sketch => Solved::awaited(scene, settings, purpose, ask),
            None => Solved::editable(scene, settings, distributions, ask).map(|(solved, accuracy, kept)| {
                editable = kept;
                (solved, accuracy)
            }),
        };
        self.interrupt = None;
        self.editable = editable.or_else(|| self.editable.take());
        let (solved, mut accuracy) = found?;
        accuracy.asked = self.status.asked;
        if is_glance {
            // It is believed to be anything.
            accuracy.believed = 1.0;
        }
        let better = self.status.shown.is_none_or(|shown| accuracy.believed < shown);
        let whole = self.wanted == Wanted::Whole;
        if self.wanted == Wanted::Nothing || !(better || in_any_case && whole) {
            return Ok(());
        }
        self.show(solved, accuracy)
    }

    /// Shows what was solved last in the light of an edit.
    fn follow(&mut self) -> Result<(), ViewError> {
        let (Some(scene), Some(mut editable)) = (self.scene.clone(), self.editable.take()) else { return Ok(()) };
        self.begin("light follows");
        let settings = Settings { transport: self.args.transport, ..Settings::with_error(self.status.asked) };
        self.interrupt = Some(Interrupt::listen());
        let found = editable.relit(scene, settings, &mut |state| match self.attend(state) {
            Wanted::Whole if state.phase == Phase::Reconstruct => Wanted::Now,
            wanted => wanted,
        });
        self.interrupt = None;
        let (solved, accuracy) = match found {
            // What needs other links gets them when it is solved anew.
            Err(SolveError::Edit { .. }) => return Ok(()),
            found => found?,
        };
        self.editable = Some(editable);
        if self.wanted == Wanted::Nothing { Ok(()) } else { self.show(solved, accuracy) }
    }

    fn mode(&self) -> Mode {
        self.args.mode.unwrap_or_default()
    }

    fn show(&mut self, solved: Solved, accuracy: Accuracy) -> Result<(), ViewError> {
        self.begin("making triangles");
        let begin = Instant::now();
        let solved = Arc::new(solved);
        let walkthrough = Walkthrough::new(Arc::clone(&solved), self.mode());
        self.screen.show(Arc::new(walkthrough)).map_err(window::WindowError::from)?;
        self.status.shown = Some(accuracy.believed);
        self.has_shown = true;
        if self.is_edited {
            return Ok(());
        }
        let times = Times {
            load: self.loaded,
            show: begin.elapsed().as_secs_f64(),
            total: self.progress.elapsed().as_secs_f64(),
        };
        let mut results = self.results.lock().unwrap_or_else(PoisonError::into_inner);
        results.best = Some((solved, accuracy, times));
        results.written = false;
        Ok(())
    }

    /// A new activity.
    fn begin(&mut self, activity: &str) {
        (self.status.activity, self.status.fraction) = (Some(activity.to_owned()), 0.0);
        self.tell();
    }

    fn tell(&mut self) {
        self.told = Instant::now();
        self.screen.status(self.status.clone());
    }

    /// Between two steps of the solver: tells how far it is, hears what is wanted.
    fn attend(&mut self, state: &hr_diffuse::Progress) -> Wanted {
        self.progress.solving(state);
        let doing = activity(state);
        if self.told.elapsed() >= TELL {
            (self.status.activity, self.status.fraction) = (Some(doing), state.fraction);
            self.tell();
        }
        loop {
            match self.wishes.try_recv() {
                Ok(wish) => self.hear(wish),
                Err(TryRecvError::Disconnected) => {
                    self.tasks.clear();
                    self.wanted = Wanted::Nothing;
                }
                Err(TryRecvError::Empty) => break,
            }
        }
        if self.interrupt.as_ref().is_some_and(Interrupt::is_raised) && self.wanted == Wanted::Whole {
            self.progress.say(STOPPING);
            self.hear(Wish::Stop);
        }
        self.look();
        while self.status.paused && self.wanted == Wanted::Whole {
            match self.wishes.recv_timeout(LOOK) {
                Ok(wish) => self.hear(wish),
                Err(RecvTimeoutError::Timeout) => self.look(),
                Err(RecvTimeoutError::Disconnected) => {
                    self.tasks.clear();
                    self.wanted = Wanted::Nothing;
                }
            }
        }
        self.wanted
    }

    fn hear(&mut self, wish: Wish) {
        match wish {
            Wish::Emission { material, factor } => self.edit(material, |material| brightened(material, factor)),
            Wish::Roughness { material, factor } => self.edit(material, |material| roughened(material, factor)),
            Wish::Finer => self.ask_for(0.5 * self.status.asked),
            Wish::Coarser => self.ask_for(2.0 * self.status.asked),
            Wish::Pause if self.status.activity.is_none() => self.screen.say("nothing is being solved"),
            Wish::Pause => {
                self.status.paused = !self.status.paused;
                self.tell();
            }
            Wish::Stop if self.status.activity.is_none() => self.screen.say("nothing is being solved"),
            Wish::Stop => {
                self.status.paused = false;
                self.tasks.clear();
                self.wanted = Wanted::Now;
                self.screen.say("stopped");
            }
        }
    }

    /// Solves for another error instead of what is being done; what is shown stays until then.
    fn ask_for(&mut self, error: f32) {
        if self.scene.is_none() {
            return self.screen.say("still loading");
        }
        self.status.asked = error.clamp(FINEST, COARSEST);
        self.again([self.status.asked]);
        self.screen.say(format!("solving to an error of {:.1} %", 100.0 * self.status.asked));
    }

    /// Solves to some errors, one after the other, instead of what is being done.
    fn again(&mut self, errors: impl IntoIterator<Item = f32>) {
        self.status.paused = false;
        self.tasks = errors.into_iter().map(|error| Task::Solve { error, in_any_case: true }).collect();
        self.wanted = Wanted::Nothing;
    }

    /// Changes a material. The light of what was solved last follows at once, where there is any; then all is solved again.
    fn edit(&mut self, material: u32, change: impl FnOnce(&mut Material) -> Result<String, String>) {
        let Some(scene) = &self.scene else { return self.screen.say("still loading") };
        let mut scene = Scene::clone(scene);
        let Some(changed) = scene.materials.get_mut(material as usize) else { return };
        match change(changed) {
            Ok(said) => self.screen.say(said),
            Err(why) => return self.screen.say(why),
        }
        self.scene = Some(Arc::new(scene));
        self.is_edited = true;
        // Any solution of the new scene is better than one of the old.
        self.status.shown = None;
        if self.editable.is_some() {
            self.again([self.status.asked]);
            self.tasks.push_front(Task::Follow);
        } else {
            self.again([(COARSER * self.status.asked).min(COARSEST), self.status.asked]);
        }
    }

    /// Looks at the scene's file now and then; reads it again where it has changed.
    fn look(&mut self) {
        if self.looked.elapsed() < LOOK {
            return;
        }
        self.looked = Instant::now();
        if self.watched.has_changed() {
            self.screen.say(format!("{} has changed, reading it again", self.args.scene));
            self.tasks.clear();
            self.tasks.push_back(Task::Load);
            self.wanted = Wanted::Nothing;
            self.status.paused = false;
        }
    }
}

/// Lets the window's threads go first: walking stays smooth while the solver takes what is left.
fn step_back(_: usize) {
    // On Linux it is the thread's own, elsewhere the process's.
    #[cfg(target_os = "linux")]
    let _niceness = rustix::process::nice(5);
}
