// The part of picture.h that draws.
#include <stb_easy_font.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "clients/cli/picture.h"

namespace pepeseg::client::cli {
namespace {

constexpr int kTextScale = 2;     // screen pixels a font pixel
constexpr int kCaptionRows = 28;  // pixels above a panel
constexpr int kGap = 8;           // pixels between panels
constexpr Rgb kPaper{250, 250, 248};
constexpr Rgb kInk{40, 40, 40};

void Put(Picture& picture, int x, int y, Rgb color) {
  if (x < 0 || y < 0 || x >= picture.width || y >= picture.height) return;
  uint8_t* pixel = picture.At(x, y);
  pixel[0] = color.r;
  pixel[1] = color.g;
  pixel[2] = color.b;
}

// Inside the mask and next to what is outside it, or to the picture's edge.
bool OnBorder(const Picture& picture, std::span<const uint8_t> mask, int x, int y) {
  const auto inside = [&](int u, int v) {
    return u >= 0 && v >= 0 && u < picture.width && v < picture.height &&
           mask[static_cast<size_t>(v) * picture.width + u] != 0;
  };
  return inside(x, y) &&
         !(inside(x - 1, y) && inside(x + 1, y) && inside(x, y - 1) && inside(x, y + 1));
}

void Mix(uint8_t* pixel, Rgb color, double share) {
  const std::array<uint8_t, 3> target = {color.r, color.g, color.b};
  for (int c = 0; c < 3; ++c) {
    pixel[c] = static_cast<uint8_t>(std::lround(pixel[c] * (1 - share) + target[c] * share));
  }
}

}  // namespace

void DrawMask(Picture& picture, std::span<const uint8_t> mask, Rgb color) {
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      if (mask[static_cast<size_t>(y) * picture.width + x] == 0) continue;
      Mix(picture.At(x, y), color, OnBorder(picture, mask, x, y) ? 1.0 : 0.45);
    }
  }
}

void DrawOutline(Picture& picture, std::span<const uint8_t> mask, Rgb color) {
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      if (OnBorder(picture, mask, x, y)) Put(picture, x, y, color);
    }
  }
}

void DrawClick(Picture& picture, double x, double y, Rgb color) {
  constexpr double kRadius = 7;
  for (int dy = -10; dy <= 10; ++dy) {
    for (int dx = -10; dx <= 10; ++dx) {
      const double off = std::abs(std::hypot(dx, dy) - kRadius);
      const auto at_x = static_cast<int>(x) + dx;
      const auto at_y = static_cast<int>(y) + dy;
      if (off < 1.2) Put(picture, at_x, at_y, color);
      if (off >= 1.2 && off < 2.2) Put(picture, at_x, at_y, kInk);
    }
  }
}

void DrawText(Picture& picture, int x, int y, absl::string_view text, Rgb color) {
  struct Vertex {  // stb_easy_font's layout
    float x, y, z;
    uint8_t rgba[4];
  };
  std::string line(text);
  std::vector<Vertex> vertices(line.size() * 4 * 24 + 4);
  const int quads = stb_easy_font_print(0, 0, line.data(), nullptr, vertices.data(),
                                        static_cast<int>(vertices.size() * sizeof(Vertex)));
  for (int quad = 0; quad < quads; ++quad) {  // axis-aligned: corners 0 and 2
    const Vertex& from = vertices[4 * quad];
    const Vertex& to = vertices[4 * quad + 2];
    for (int v = static_cast<int>(from.y * kTextScale); v < to.y * kTextScale; ++v) {
      for (int u = static_cast<int>(from.x * kTextScale); u < to.x * kTextScale; ++u) {
        Put(picture, x + u, y + v, color);
      }
    }
  }
}

Picture SideBySide(std::span<const Panel> panels) {
  const Picture& first = panels.front().picture;
  const int count = static_cast<int>(panels.size());
  Picture sheet = Picture::Filled(count * first.width + (count - 1) * kGap,
                                  first.height + kCaptionRows, kPaper);
  for (int i = 0; i < count; ++i) {
    const int left = i * (first.width + kGap);
    DrawText(sheet, left + 4, 6, panels[i].caption, kInk);
    for (int y = 0; y < first.height; ++y) {
      const uint8_t* row = panels[i].picture.At(0, y);
      std::copy(row, row + static_cast<size_t>(first.width) * 3, sheet.At(left, y + kCaptionRows));
    }
  }
  return sheet;
}

}  // namespace pepeseg::client::cli
