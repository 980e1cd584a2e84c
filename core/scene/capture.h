#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/camera.h"
#include "core/scene/mask_set.h"
#include "core/scene/photograph.h"

namespace pepeseg {

// Interleaved 8-bit image [height, width, channels], RGB when it has three channels.
struct Image {
  int width = 0;
  int height = 0;
  int channels = 0;
  std::vector<uint8_t> pixels;
};

// What a monocular network, a sensor or a sparse model says of a view's depth, up to scale and
// shift (METHOD.md section 0).
struct DepthPrior {
  enum class Kind {
    kDisparity,  // near is large, as 1 / z
    kDepth,      // far is large, as z
  };
  Kind kind = Kind::kDisparity;
  // [height, width], mapped so that the 0.1 and 99.9 percentiles are 0 and 1, and clamped there;
  // NaN where nothing is known. Empty: the view has none.
  std::vector<float> values;
  // Made of the capture's points: it shows what belongs together, but a reconstruction that starts
  // from the same points learns nothing of it.
  bool from_points = false;
};

// A photograph with its camera and what is known about it; all of one size.
struct View {
  std::string name;  // of the image file below images/: metadata, never a path of ours
  Camera camera;
  Pose cam_from_world;
  bool held_out = false;  // for testing: never trained on
  Image photo;            // RGB
  std::vector<uint8_t>
      ignore;  // [height, width], non-zero: neither trained on nor scored; or empty
  MaskSet masks;
  DepthPrior depth;
  // What `photo` was made of; none: it is the photograph.
  std::optional<Photograph> photograph = std::nullopt;
};

// True when the view has a prior that knows at least one pixel.
bool HasDepthPrior(const View& view);

struct ScenePoint {
  Eigen::Vector3f position;
  uint8_t rgb[3] = {};
};

// What stage one starts from. Views are sorted by name.
struct Capture {
  std::vector<View> views;
  std::vector<ScenePoint> points;
  // Poses and points are relative to it: a place in the world of the dataset, see origin.h.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  std::vector<std::string> warnings;  // for the job's log: what was left out, and why
};

// True when a view that is trained on has a depth prior.
bool HasTrainingDepth(const Capture& capture);

// Likewise of depth that says more than the points do.
bool HasGeometryPrior(const View& view);
bool HasTrainingGeometry(const Capture& capture);

// Radius of the camera centres about their mean, times 1.1 (3DGS's "extent"): the unit of learning
// rates and of density control. Where they all stand at one place (within a thousandth of that), it
// is the median distance to the points, and where there are none, either, 1.
double SceneRadius(const Capture& capture);

}  // namespace pepeseg
