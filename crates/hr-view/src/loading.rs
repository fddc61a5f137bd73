//! Loading the scene that the command line names.

use crate::ViewError;
use crate::args::Args;
use crate::progress::Progress;
use hr_scene::{Camera, Rgb, Scene};
use std::sync::Arc;

/// So many warnings about the scene are told; of the others, how many there are.
const MOST_WARNINGS: usize = 8;

/// The scene, with the camera of the command line first.
pub(crate) fn load(args: &Args, progress: &Progress) -> Result<Arc<Scene>, ViewError> {
    progress.at(&format!("loading {}", args.scene), 0.0);
    // A camera's file first: it is read at once, and a mistake in it shows before the wait for a large scene.
    let in_file = args.camera.as_deref().filter(|name| Camera::is_file(name)).map(Camera::load).transpose()?;
    let mut scene = Scene::load(&args.scene)?;
    for material in &args.leave_out {
        scene.leave_out(material)?;
    }
    if let Some(camera) = in_file {
        scene.cameras.insert(0, ("--camera".to_owned(), camera));
    } else if let Some(name) = &args.camera {
        let name = name.to_string_lossy().into_owned();
        let camera = scene.camera_named(&name)?;
        scene.cameras.retain(|(known, _)| *known != name);
        scene.cameras.insert(0, (name, camera));
    } else if scene.cameras.is_empty() {
        scene.cameras.push(("default".to_owned(), scene.default_camera()));
    }
    if let Some(radiance) = args.sky {
        scene.add_sky(Rgb::splat(radiance))?;
    }
    for warning in scene.warnings.iter().take(MOST_WARNINGS) {
        let times = if warning.count > 1 { format!(", {} times", warning.count) } else { String::new() };
        progress.say(&format!("warning: {} ({}{times})", warning.text, warning.first));
    }
    if let Some(more) = scene.warnings.len().checked_sub(MOST_WARNINGS).filter(|more| *more > 0) {
        progress.say(&format!("warning: {more} more kinds of warnings"));
    }
    if scene.is_dark() {
        progress.say(
            "warning: nothing in the scene shines, all will be black; give a material emission, add a light, such as one of \
             KHR_lights_punctual, or let light come from everywhere by --sky 1",
        );
    }
    Ok(Arc::new(scene))
}
