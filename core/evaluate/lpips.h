#pragma once

#include <filesystem>
#include <memory>
#include <span>

#include "absl/status/statusor.h"
#include "core/scene/capture.h"

namespace pepeseg {

// LPIPS (Zhang et al. 2018) by a network that its user brings, as an ONNX file. Its inputs are two
// images [1, 3, height, width] in [-1, 1] of any size, named "photo" and "rendering"; its outputs
// are maps, whose means are summed here, in double: OpenCV's are floats, and 0.4 % off at 640x480.
// README.md has the recipe: of LPIPS exported as it stands, Debian's OpenCV 4.6 computes something
// else without an error (it multiplies where a constant vector divides, and averages over the size
// of the export). The inputs' names tell the two apart. Not thread safe.
class Lpips {
 public:
  // INVALID_ARGUMENT names the file: no such network, or, on two small images, no distance that is
  // finite, 0 of equal images and above of different ones. NOT_FOUND: no such file.
  static absl::StatusOr<Lpips> Open(const std::filesystem::path& weights);
  Lpips(Lpips&& other) noexcept;
  Lpips& operator=(Lpips&& other) noexcept;
  ~Lpips();

  // Of an RGB photograph and a rendering of its size, [height, width, 3] in [0, 1]. INTERNAL: the
  // network cannot take images of this size, or not in the memory there is.
  absl::StatusOr<double> Distance(const Image& photo, std::span<const float> rendering);

 private:
  struct Network;
  explicit Lpips(std::unique_ptr<Network> network);
  std::unique_ptr<Network> network_;
};

}  // namespace pepeseg
