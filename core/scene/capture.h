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

// An image of one float per pixel, row-major [height, width], top scanline first.
struct FloatImage {
  int width = 0;
  int height = 0;
  std::vector<float> values;
};

// Depth of a view by a monocular network, a depth sensor or the capture's points, known up to scale
// and shift (METHOD.md section 0).
struct DepthPrior {
  enum class Kind {
    kDisparity,  // grows towards the camera, as 1 / z
    kDepth,      // grows away from the camera, as z
  };
  Kind kind = Kind::kDisparity;
  // [height, width], as NormalizeDepth returns it: in [0, 1], NaN where the depth is unknown.
  // Empty: the view has no prior.
  std::vector<float> values;
  // True when the values come from the capture's own points. Stage two uses them; stage one does
  // not, because it already starts from those points.
  bool from_points = false;
};

// Maps the 0.1 and 99.9 percentiles of the known values to 0 and 1, and clamps the rest to that
// range. NaN marks an unknown value and stays NaN. Returns an empty vector if no value is known, or
// if both percentiles are equal or not finite: such a prior holds no information.
std::vector<float> NormalizeDepth(std::vector<float> values);

// One posed photograph and its priors. Photo, masks, depth and ignore mask all have the camera's
// width and height.
struct View {
  std::string name;  // of the image file, relative to images/; a label, never opened as a path
  Camera camera;
  Pose cam_from_world;
  bool held_out = false;  // reserved for evaluation, never trained on
  Image photo;            // RGB
  // [height, width]; pixels with a non-zero value are neither trained on nor scored. Empty: none.
  std::vector<uint8_t> ignore;
  MaskSet masks;
  DepthPrior depth;
  // The uploaded photograph that `photo` was undistorted, cropped or resized from. Absent: `photo`
  // is the upload itself.
  std::optional<Photograph> photograph = std::nullopt;
};

// Returns GridPixels of the view's camera without the pixels that the view ignores.
std::vector<int32_t> KnownGridPixels(const View& view, double max_cells);

// Returns true if the depth prior of the view has at least one known pixel.
bool HasDepthPrior(const View& view);

struct ScenePoint {
  Eigen::Vector3f position;  // scene units, relative to Capture::origin
  uint8_t rgb[3] = {};
};

// The input of stage one.
struct Capture {
  std::vector<View> views;  // sorted by name
  std::vector<ScenePoint> points;
  // Origin of the coordinates of poses and points, in the world of the dataset; see OriginOf.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  std::vector<std::string> warnings;  // for the job's log: what was left out, and why
};

// Returns true if at least one training view has a depth prior.
bool HasTrainingDepth(const Capture& capture);

// Return true if the view, or at least one training view, has a depth prior that is not made of the
// capture's points.
bool HasGeometryPrior(const View& view);
bool HasTrainingGeometry(const Capture& capture);

// Returns 1.1 times the radius of the camera centres about their mean (3DGS's "extent"), in scene
// units: learning rates and density control are relative to it. If the cameras stand at one place
// (their radius is below a thousandth of the median distance to the points), returns that distance.
// If there are no points either, returns 1.
double SceneRadius(const Capture& capture);

}  // namespace pepeseg
