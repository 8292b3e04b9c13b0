//! The overlay of the picture: panels, lines and texts in pixels, from the upper left corner.

/// A colour with its opacity, each part from 0 to 1.
pub type Rgba = [f32; 4];

/// A rectangle of the screen, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area {
    pub x: f32,
    pub y: f32,
    pub width: f32,
    pub height: f32,
}

impl Area {
    /// Returns the point at shares of the width and the height, the latter from the lower border.
    pub fn at(&self, x: f32, y: f32) -> [f32; 2] {
        [self.x + x * self.width, self.y + (1.0 - y) * self.height]
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    pub area: Area,
    pub colour: Rgba,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Text {
    pub text: String,
    /// The upper left corner.
    pub at: [f32; 2],
    /// The height of the line.
    pub size: f32,
    pub colour: Rgba,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    pub ends: [[f32; 2]; 2],
    pub width: f32,
    pub colour: Rgba,
}

/// Everything that is written over one picture; panels lie under lines, and lines under texts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sheet {
    pub panels: Vec<Panel>,
    pub lines: Vec<Line>,
    pub texts: Vec<Text>,
}

impl Sheet {
    pub fn panel(&mut self, area: Area, colour: Rgba) {
        self.panels.push(Panel { area, colour });
    }

    pub fn text(&mut self, text: impl Into<String>, at: [f32; 2], size: f32, colour: Rgba) {
        self.texts.push(Text { text: text.into(), at, size, colour });
    }

    /// Adds lines from point to point.
    pub fn path(&mut self, points: &[[f32; 2]], width: f32, colour: Rgba) {
        let lines = points.windows(2).map(|ends| Line { ends: [ends[0], ends[1]], width, colour });
        self.lines.extend(lines);
    }
}
