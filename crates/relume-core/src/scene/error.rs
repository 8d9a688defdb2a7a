//! What can be wrong with a scene so that nothing can be made of it.
//!
//! Every message says which file, node, mesh or extension it is about and what to do. This file
//! must not know how scenes are read or assembled.

/// Why there is no scene: a file that cannot be read, or content that cannot be lit.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The file, or one that it refers to, cannot be opened or read.
    #[error("cannot read `{file}`: {source}; {remedy}")]
    Read {
        /// The file, as the user or the glTF file named it.
        file: String,
        /// Error of the operating system.
        source: std::io::Error,
        /// What to do.
        remedy: String,
    },
    /// The file is not glTF 2.0 or is damaged.
    #[error("`{file}` is not a valid glTF 2.0 file: {what}; {remedy}")]
    Format {
        /// The file.
        file: String,
        /// What is wrong, and where.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// The file refers to another one outside of its own folder.
    #[error("`{file}`: {what}; {remedy}")]
    Outside {
        /// The file.
        file: String,
        /// What it refers to, and what for.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// A file, an image or a list of numbers is larger than the memory allowed, by itself.
    #[error(
        "`{file}`: {what} needs {needs_bytes} bytes, more than the {limit_bytes} of memory allowed; {remedy}"
    )]
    TooLarge {
        /// The file.
        file: String,
        /// What of it.
        what: String,
        /// Bytes that it would take.
        needs_bytes: u64,
        /// Bytes allowed.
        limit_bytes: u64,
        /// What to do.
        remedy: String,
    },
    /// A line of a View3D file is malformed or not supported.
    #[error("`{file}`{at}: {what}; {remedy}", at = at(*line))]
    View3d {
        /// The file.
        file: String,
        /// The line, from 1; 0 for the whole file.
        line: usize,
        /// What is wrong.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// A file of meshes that is damaged or too large.
    #[error("`{file}` is not a valid {format} file: {what}; {remedy}")]
    Mesh {
        /// The file.
        file: String,
        /// OBJ, STL or PLY.
        format: &'static str,
        /// What is wrong, and where.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// The file needs an extension that is not supported.
    #[error("`{file}` needs the extension {extension}: {remedy}")]
    Extension {
        /// The file.
        file: String,
        /// The extension's name.
        extension: String,
        /// What to do.
        remedy: String,
    },
    /// A mesh, surface or light holds numbers of which no geometry can be made.
    #[error("{subject}: {what}; {remedy}")]
    Geometry {
        /// The mesh, node or surface, with its name.
        subject: String,
        /// What is wrong.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// A material whose numbers are outside physics.
    #[error("material `{material}`: {what}; {remedy}")]
    Material {
        /// The material's name.
        material: String,
        /// What is wrong.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// A node tree that is not a tree, or a node that does not exist.
    #[error("node `{node}`: {what}; {remedy}")]
    Hierarchy {
        /// The node's name.
        node: String,
        /// What is wrong.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// Keyframes that make no sense, or an animation that is not there.
    #[error("animation `{animation}`: {what}; {remedy}")]
    Animation {
        /// The animation's or the node's name.
        animation: String,
        /// What is wrong.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// An edit names something that the scene does not have.
    #[error("{what}; {remedy}")]
    Edit {
        /// What is not there, and what is.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// There is no polygon to light.
    #[error("scene `{scene}` has no polygon to light: {what}; {remedy}")]
    Empty {
        /// The scene's name.
        scene: String,
        /// What was found instead.
        what: String,
        /// What to do.
        remedy: String,
    },
}

impl SceneError {
    /// What to do about it, as a sentence without capital or full stop; it ends the message too.
    pub fn remedy(&self) -> &str {
        match self {
            SceneError::Read { remedy, .. }
            | SceneError::Format { remedy, .. }
            | SceneError::Outside { remedy, .. }
            | SceneError::TooLarge { remedy, .. }
            | SceneError::View3d { remedy, .. }
            | SceneError::Mesh { remedy, .. }
            | SceneError::Extension { remedy, .. }
            | SceneError::Geometry { remedy, .. }
            | SceneError::Material { remedy, .. }
            | SceneError::Hierarchy { remedy, .. }
            | SceneError::Animation { remedy, .. }
            | SceneError::Edit { remedy, .. }
            | SceneError::Empty { remedy, .. } => remedy,
        }
    }
}

fn at(line: usize) -> String {
    if line == 0 { String::new() } else { format!(", line {line}") }
}
