//! From what a user names (a file, a built-in scene, a mesh, standard input) to a scene, and where it may look for meshes.

use super::{Refusal, Scene, Target, builtin};
use crate::target::{self, Import, ImportOptions};
use std::io::Read;
use std::path::{Path, PathBuf};

/// A scene with the place that it came from.
#[derive(Clone, Debug)]
pub struct Opened {
    /// The scene.
    pub scene: Scene,
    /// Where its meshes are looked for.
    pub place: Place,
    /// What to call it: the name of the file or of the built-in scene.
    pub title: String,
    /// The scene's own file, where it has one.
    pub file: Option<PathBuf>,
}

/// Where a scene may look for meshes: in its own folder, and at paths that the user named.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    folder: PathBuf,
    named: Vec<PathBuf>,
}

/// Largest scene or recording that is read, bytes.
const LARGEST_TEXT: u64 = 256 << 20;

/// Opens what a user named: a `.ron` file, a mesh file, a built-in scene, or `-` for standard input.
///
/// # Errors
/// A name that leads nowhere, a file that cannot be read, a scene that is refused (with its place in the file).
pub fn open(name: &str) -> Result<Opened, Refusal> {
    if name == "-" {
        let text = text_of(std::io::stdin(), "standard input")?;
        let scene = Scene::from_ron(&text).map_err(|e| e.at("standard input"))?;
        return Ok(Opened {
            scene,
            place: Place::folder("."),
            title: "standard input".to_owned(),
            file: None,
        });
    }
    let path = Path::new(name);
    match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("ron") => {
            let text = text_of(open_file(path)?, name)?;
            let scene = Scene::from_ron(&text).map_err(|e| e.at(name))?;
            let folder = path.parent().unwrap_or(Path::new("."));
            let title = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            Ok(Opened { scene, place: Place::folder(folder), title, file: Some(path.to_owned()) })
        }
        Some("obj" | "gltf" | "glb") => {
            let mut place = Place::folder(".");
            place.allow(name);
            let scene = Scene { target: Target::mesh(name), ..Scene::default() };
            Ok(Opened { scene, place, title: name.to_owned(), file: None })
        }
        _ => match builtin::find(name) {
            Some(known) => Ok(Opened {
                scene: (known.make)(),
                place: Place::default(),
                title: known.name.to_owned(),
                file: None,
            }),
            None => Err(Refusal::new(format!(
                "there is no scene '{}'; accepted: a .ron, .obj, .gltf or .glb file, - for standard input, or one of {}",
                crate::params::excerpt(name),
                builtin::ALL.iter().map(|s| s.name).collect::<Vec<_>>().join(", ")
            ))),
        },
    }
}

impl Place {
    /// A scene's own folder.
    pub fn folder(folder: impl AsRef<Path>) -> Self {
        let folder = folder.as_ref();
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        Self { folder: folder.to_owned(), named: Vec::new() }
    }

    /// Lets the scene open a path that the user named.
    pub fn allow(&mut self, path: impl Into<PathBuf>) {
        self.named.push(path.into());
    }

    /// The scene as it must be written into a file of another folder so that it still finds its mesh: with the mesh's
    /// path relative to that folder where it lies inside, else with its full path, which whoever opens the file must
    /// then name.
    pub fn moved(&self, scene: &Scene, folder: &Path) -> Scene {
        let mut scene = scene.clone();
        if let Target::Mesh(mesh) = &mut scene.target
            && mesh.asset().is_none()
            && let Some(file) = self.resolve(Path::new(&mesh.path)).ok().and_then(|f| f.canonicalize().ok())
        {
            let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
            let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
            let path = file.strip_prefix(&folder).unwrap_or(&file);
            mesh.path = path.to_string_lossy().into_owned();
        }
        scene
    }

    /// Reads the mesh that a scene names.
    pub(super) fn import(&self, path: &str, options: &ImportOptions) -> Result<Import, Refusal> {
        if let Some(name) = path.strip_prefix("asset:") {
            let bytes = builtin::asset(name)?;
            return target::import_bytes(name, bytes, None, options).map_err(|e| Refusal::new(e.to_string()));
        }
        let found = self.resolve(Path::new(path))?;
        target::import_file(&found, options).map_err(|e| Refusal::new(e.to_string()))
    }

    /// The file that a path in the scene means; nothing outside the scene's folder unless the user named it.
    fn resolve(&self, path: &Path) -> Result<PathBuf, Refusal> {
        if self.named.iter().any(|named| named == path) {
            return Ok(path.to_owned());
        }
        let shown = path.display();
        if self.folder.as_os_str().is_empty() {
            return Err(Refusal::new(format!("{shown}: a built-in scene opens no files")));
        }
        let real = |p: &Path| p.canonicalize().map_err(|e| Refusal::new(format!("{}: {e}", p.display())));
        let file = real(&self.folder.join(path))?;
        if file.starts_with(real(&self.folder)?) {
            Ok(self.folder.join(path))
        } else {
            Err(Refusal::new(format!(
                "{shown}: lies outside the scene's folder {}; accepted: a path inside it, or one named on the command line",
                self.folder.display()
            )))
        }
    }
}

fn open_file(path: &Path) -> Result<std::fs::File, Refusal> {
    std::fs::File::open(path).map_err(|e| Refusal::new(format!("{}: {e}", path.display())))
}

/// The text of a file that is not larger than a scene or recording can be.
///
/// # Errors
/// A file that cannot be read, is too large, or is not UTF-8.
pub fn read_limited(path: &Path) -> Result<String, Refusal> {
    text_of(open_file(path)?, &path.display().to_string())
}

fn text_of(from: impl Read, name: &str) -> Result<String, Refusal> {
    let mut bytes = Vec::new();
    from.take(LARGEST_TEXT + 1).read_to_end(&mut bytes).map_err(|e| Refusal::new(format!("{name}: {e}")))?;
    if bytes.len() as u64 > LARGEST_TEXT {
        return Err(Refusal::new(format!("{name}: is larger than {} MiB", LARGEST_TEXT >> 20)));
    }
    String::from_utf8(bytes).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        Refusal::new(format!("{name}: byte {at} is not UTF-8; accepted: UTF-8 text"))
    })
}
