//! The generated sheet: rows and columns of particles, or a chain where there is only one of either.

use glam::DVec3;

use super::QuadMesh;

/// A sheet of `columns` x `rows` particles, `spacing` m apart; particle index = row * columns + column.
///
/// Column c stands at x = (c - (columns - 1) / 2) * spacing. Horizontal: row r at y = 0, z = (r - (rows - 1) / 2) * spacing.
/// Vertical: z = 0, y = -r * spacing, so that row 0 is on top. A single row or column has no faces and is a chain of edges.
pub fn grid(columns: u32, rows: u32, spacing: f64, vertical: bool) -> QuadMesh {
    let middle = |count: u32| (f64::from(count) - 1.0) / 2.0;
    let position = |row: u32, column: u32| {
        let x = (f64::from(column) - middle(columns)) * spacing;
        let (y, z) = if vertical {
            (-f64::from(row) * spacing, 0.0)
        } else {
            (0.0, (f64::from(row) - middle(rows)) * spacing)
        };
        // Adding +0.0 turns -0.0 into +0.0.
        DVec3::new(x, y, z) + DVec3::ZERO
    };
    let mut positions = Vec::with_capacity(rows as usize * columns as usize);
    for row in 0..rows {
        positions.extend((0..columns).map(|column| position(row, column)));
    }
    let mut mesh = QuadMesh::new(positions);
    if rows == 1 || columns == 1 {
        for second in 1..rows * columns {
            mesh.push_edge([second - 1, second]);
        }
        return mesh;
    }
    let faces = (rows as usize - 1) * (columns as usize - 1);
    mesh.reserve(faces, 4 * faces);
    for row in 1..rows {
        for column in 1..columns {
            let corner = row * columns + column;
            // Anticlockwise seen from above, or from +z where it is upright: that side is the front.
            mesh.push_face(&[corner - 1, corner, corner - columns, corner - columns - 1]);
        }
    }
    mesh
}
