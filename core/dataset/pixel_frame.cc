#include "core/dataset/pixel_frame.h"

#include "core/scene/photograph.h"

namespace pepeseg {
namespace {

// The turn of an image of width x height.
class Turn {
 public:
  Turn(int width, int height, int orientation) {
    photograph_.lens.width = width;
    photograph_.lens.height = height;
    photograph_.orientation = orientation;
  }

  int width() const { return photograph_.UprightWidth(); }
  int height() const { return photograph_.UprightHeight(); }

  // Returns, for each pixel of the turned image, its index in the image.
  std::vector<int32_t> SourcePixels() const {
    std::vector<int32_t> source;
    source.reserve(static_cast<size_t>(width()) * height());
    for (int y = 0; y < height(); ++y) {
      for (int x = 0; x < width(); ++x) {
        const Eigen::Vector2d from = photograph_.ToStored({x + 0.5, y + 0.5});
        source.push_back(static_cast<int32_t>(from.y()) * photograph_.lens.width +
                         static_cast<int32_t>(from.x()));
      }
    }
    return source;
  }

 private:
  Photograph photograph_;
};

template <class T>
std::vector<T> Gather(const std::vector<T>& values, const std::vector<int32_t>& source) {
  std::vector<T> result;
  result.reserve(source.size());
  for (const int32_t pixel : source) result.push_back(values[static_cast<size_t>(pixel)]);
  return result;
}

}  // namespace

const char* NameOf(PixelFrame frame) { return frame == PixelFrame::kStored ? "stored" : "upright"; }

// A quarter turn to the right and one to the left undo each other; all others undo themselves.
int InverseOrientation(int orientation) {
  constexpr int kRight = 6, kLeft = 8;
  if (orientation == kRight) return kLeft;
  return orientation == kLeft ? kRight : orientation;
}

MaskSet Turned(const MaskSet& masks, int orientation) {
  if (orientation == 1 || masks.empty()) return masks;
  const Turn turn(masks.width, masks.height, orientation);
  return ResampleMaskSet(masks, turn.width(), turn.height(), turn.SourcePixels());
}

FloatImage Turned(const FloatImage& map, int orientation) {
  if (orientation == 1) return map;
  const Turn turn(map.width, map.height, orientation);
  return {turn.width(), turn.height(), Gather(map.values, turn.SourcePixels())};
}

std::vector<uint8_t> Turned(const std::vector<uint8_t>& values, int width, int height,
                            int orientation) {
  if (orientation == 1) return values;
  return Gather(values, Turn(width, height, orientation).SourcePixels());
}

}  // namespace pepeseg
