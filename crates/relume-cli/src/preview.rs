//! Rough pictures of what is not solved: those of `--preview`, and one that is there while the first frame takes long.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use relume::export::write_atomically;
use relume::scene::Scene;
use relume_picture::picture::{Exposure, Settings, Sketch, View};

use crate::args::{ExposureFlag, PictureFlags, Shading};
use crate::clip::{self, Clip, fixed};
use crate::failure::Failure;
use crate::interrupt;
use crate::output::{self, counted};
use crate::viewing::Viewing;

/// The first frame has this long, from the start of the run, before a rough picture is drawn beside it.
pub(crate) const PATIENCE: Duration = Duration::from_secs(2);

/// A rough picture that is drawn where the first frame takes long, and goes when that is finished.
pub(crate) struct Meanwhile {
    /// Dropped when there is no more need.
    wanted: Option<Sender<()>>,
    state: Arc<Mutex<State>>,
}

#[derive(PartialEq)]
enum State {
    Wanted,
    Written,
    Over,
}

impl Meanwhile {
    /// A picture of a scene at `time_s` seconds, in a file; `say` is told when it is there.
    pub(crate) fn new(
        (scene, time_s): (Arc<Scene>, f64),
        (view, settings): (View, Settings),
        (path, patience): (PathBuf, Duration),
        say: impl Fn(&str) + Send + 'static,
    ) -> Meanwhile {
        let (wanted, over) = mpsc::channel::<()>();
        let state = Arc::new(Mutex::new(State::Wanted));
        let shared = Arc::clone(&state);
        // No work of the engine: its results do not depend on it.
        #[allow(clippy::disallowed_methods)]
        std::thread::spawn(move || {
            if over.recv_timeout(patience) != Err(RecvTimeoutError::Timeout) {
                return;
            }
            // On a thread of its own: those of the engine are busy as long as the frame takes, and that is when it is wanted.
            let own = rayon::ThreadPoolBuilder::new().num_threads(1).build();
            let Ok(own) = own else { return };
            let image = own.install(|| Sketch::new(&scene, time_s).draw(&view, &settings));
            let Ok(bytes) = image.to_png() else { return };
            let mut state = interrupt::locked(&shared);
            let _guard = interrupt::writing();
            // A picture that cannot be written is no reason to stop: the frame's own will say so.
            if *state == State::Wanted && write_atomically(&path, &bytes).is_ok() {
                *state = State::Written;
                say(&format!(
                    "note: this takes a while; {} shows roughly what the first frame will look like",
                    path.display()
                ));
            }
        });
        Meanwhile { wanted: Some(wanted), state }
    }

    /// There is a better one: takes the picture away.
    pub(crate) fn end(&mut self, path: &Path) {
        self.wanted = None;
        let before = std::mem::replace(&mut *interrupt::locked(&self.state), State::Over);
        if before == State::Written {
            // Gone already is as good.
            let _ = fs::remove_file(path);
        }
    }
}

/// The file of the rough picture beside a first frame.
pub(crate) fn path(dir: &Path) -> PathBuf {
    dir.join("preview.png")
}

/// How rough pictures are drawn.
pub(crate) fn settings(flags: &PictureFlags) -> Settings {
    let exposure = match flags.exposure {
        ExposureFlag::Auto => Exposure::Automatic,
        ExposureFlag::Stops(stops) => fixed(stops),
    };
    clip::picture_settings(flags, Shading::Gouraud, exposure)
}

/// Draws rough pictures of the frames of a clip, `preview-0000.png` ..., and solves nothing.
pub(crate) fn draw(
    clip: &Clip,
    views: &Viewing,
    flags: &PictureFlags,
    dir: &Path,
) -> Result<(), Failure> {
    let mut settings = settings(flags);
    let mut sketch: Option<Sketch> = None;
    let moves = clip.scene.motion.duration_s > 0.0;
    for &frame in &clip.frames {
        if interrupt::requested() {
            return Err(Failure::interrupted("stopped"));
        }
        let now = sketch.take().filter(|_| !moves);
        let now = now.unwrap_or_else(|| Sketch::new(&clip.scene, clip.time_of(frame)));
        let view = views.at(&clip.scene, frame, clip.fps())?;
        if settings.exposure == Exposure::Automatic {
            settings.exposure = now.exposure(&view);
        }
        let bytes = now.draw(&view, &settings).to_png().map_err(Failure::new)?;
        let path = dir.join(format!("preview-{frame:04}.png"));
        let _guard = interrupt::writing();
        write_atomically(&path, &bytes).map_err(|error| Failure::write(&path, &error))?;
        sketch = Some(now);
    }
    let count = counted(clip.frames.len(), "rough picture");
    output::print(&format!("{count} in {}, nothing was solved\n", dir.display()))
}

#[cfg(test)]
mod tests {
    use relume_picture::picture::is_whole_png;

    use super::*;
    use crate::args::DemoScene;
    use crate::demo;

    fn room() -> (Arc<Scene>, View) {
        let scene = Arc::new((demo::demo(DemoScene::Room).build)().unwrap());
        let view = View::automatic(&scene);
        (scene, view)
    }

    fn start(
        (scene, view): (Arc<Scene>, View),
        path: &Path,
        patience: Duration,
    ) -> (Meanwhile, mpsc::Receiver<String>) {
        let settings = Settings { width: 32, height: 24, ..Settings::default() };
        let (tell, told) = mpsc::channel();
        let say = move |line: &str| tell.send(line.to_owned()).unwrap();
        (Meanwhile::new((scene, 0.0), (view, settings), (path.to_owned(), patience), say), told)
    }

    #[test]
    fn a_rough_picture_is_there_until_there_is_a_better_one() {
        let dir = tempfile::tempdir().unwrap();
        let path = path(dir.path());
        let (mut meanwhile, told) = start(room(), &path, Duration::ZERO);
        assert!(told.recv().unwrap().contains("preview.png"));
        let bytes = fs::read(&path).unwrap();
        assert!(is_whole_png(&bytes));
        meanwhile.end(&path);
        assert!(!path.exists());
    }

    /// While every thread of the engine works, as it does for as long as a first frame takes.
    #[test]
    fn a_rough_picture_waits_for_no_thread_of_the_engine() {
        let dir = tempfile::tempdir().unwrap();
        let path = path(dir.path());
        let (release, held) = mpsc::channel::<()>();
        let (room, held) = (room(), Mutex::new(held));
        rayon::scope(|scope| {
            for _ in 0..rayon::current_num_threads() {
                // Until the sender is gone.
                scope.spawn(|_| assert!(interrupt::locked(&held).recv().is_err()));
            }
            let (mut meanwhile, told) = start(room, &path, Duration::ZERO);
            let said = told.recv_timeout(Duration::from_secs(60));
            meanwhile.end(&path);
            drop(release);
            assert!(said.unwrap().contains("preview.png"));
        });
    }

    #[test]
    fn what_is_soon_finished_needs_none() {
        let dir = tempfile::tempdir().unwrap();
        let path = path(dir.path());
        let (mut meanwhile, told) = start(room(), &path, Duration::from_secs(3600));
        meanwhile.end(&path);
        assert!(told.recv().is_err());
        assert!(!path.exists());
    }
}
