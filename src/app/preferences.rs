//! What is remembered from one session to the next: window, layout, display, and the files that were open lately.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::render::Style;
use crate::scene::{Pending, read_limited, to_ron};

/// Recent files that are kept.
const RECENT: usize = 12;
/// Meshes outside of a scene's folder that the user has opened himself, and that a scene may therefore open again.
const MESHES: usize = 64;

/// The preferences.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Preferences {
    /// Width and height inside of the window's frame, points.
    pub size: [f32; 2],
    /// The window fills the screen.
    pub maximized: bool,
    /// Width of the panels on the left and on the right, and height of the lanes' table, points.
    pub panels: [f32; 3],
    /// Memory that the timeline may take, MB.
    pub timeline: u32,
    /// What is shown.
    pub style: Style,
    /// Scenes and meshes that were open, the last one first.
    pub recent: Vec<PathBuf>,
    /// Meshes that the user has opened by name.
    pub meshes: Vec<PathBuf>,
}

impl Default for Preferences {
    fn default() -> Self {
        Self {
            size: [1280.0, 800.0],
            maximized: false,
            panels: [330.0, 290.0, 150.0],
            timeline: 256,
            style: Style::default(),
            recent: Vec::new(),
            meshes: Vec::new(),
        }
    }
}

impl Preferences {
    /// Where they are kept, unless the system names no such place.
    pub fn file() -> Option<PathBuf> {
        let set = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
        let folder = if cfg!(windows) {
            set("APPDATA")
        } else if cfg!(target_os = "macos") {
            set("HOME").map(|home| home.join("Library/Application Support"))
        } else {
            set("XDG_CONFIG_HOME").or_else(|| set("HOME").map(|home| home.join(".config")))
        };
        folder.map(|folder| folder.join("tenter").join("window.ron"))
    }

    /// Those of a file; the defaults where it is not there or not readable.
    pub fn load(file: &Path) -> Self {
        let text = read_limited(file).unwrap_or_default();
        let mut read: Self = ron::from_str(&text).unwrap_or_default();
        let fits = |size: f32| size.is_finite() && (320.0..=16_000.0).contains(&size);
        if !read.size.iter().all(|size| fits(*size)) {
            read.size = Self::default().size;
        }
        read
    }

    /// Writes them. That they cannot be written is no reason to bother anybody.
    pub fn save(&self, file: &Path) {
        let Ok(text) = to_ron(self) else { return };
        if let Some(folder) = file.parent() {
            let _ = std::fs::create_dir_all(folder);
        }
        let _ = Pending::new(file).and_then(|pending| pending.finish(text.as_bytes()));
    }

    /// A file was opened or saved.
    pub fn remember(&mut self, file: &Path) {
        let file = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
        self.recent.retain(|known| *known != file);
        self.recent.insert(0, file);
        self.recent.truncate(RECENT);
    }

    /// The user has named a mesh: scenes may open it from now on.
    pub fn allow(&mut self, mesh: &Path) {
        let mesh = mesh.canonicalize().unwrap_or_else(|_| mesh.to_owned());
        self.meshes.retain(|known| *known != mesh);
        self.meshes.insert(0, mesh);
        self.meshes.truncate(MESHES);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_come_back_as_they_were() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("deep").join("window.ron");
        let mut preferences = Preferences { panels: [300.0, 250.0, 120.0], ..Preferences::default() };
        preferences.remember(Path::new("/a/scene.ron"));
        preferences.remember(Path::new("/b/other.ron"));
        preferences.remember(Path::new("/a/scene.ron"));
        preferences.save(&file);
        let back = Preferences::load(&file);
        assert_eq!(back, preferences);
        assert_eq!(back.recent, [PathBuf::from("/a/scene.ron"), PathBuf::from("/b/other.ron")]);
    }

    #[test]
    fn a_file_that_is_not_readable_gives_the_defaults() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("window.ron");
        assert_eq!(Preferences::load(&file), Preferences::default());
        for text in ["(size: (1e9, 3))", "(", "(size: \"x\")", "(what: 3)"] {
            std::fs::write(&file, text).expect("writes");
            assert_eq!(Preferences::load(&file).size, Preferences::default().size, "{text}");
        }
    }
}
