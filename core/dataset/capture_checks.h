#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/dataset/dataset_index.h"
#include "core/scene/camera.h"
#include "core/scene/capture.h"
#include "core/scene/lens.h"

// Checks what people bring before anything is trained on it: whether poses, points and ignore masks
// fit each other.
namespace pepeseg {

// A camera as the file of poses has it.
struct PosedLens {
  Lens lens;
  Pose cam_from_world;
};

// Returns the pixel to which a camera projects a point, without the distortion of its lens, or
// nothing if the point is behind the camera or outside of its image.
std::optional<Eigen::Vector2d> Project(const PosedLens& camera, const Eigen::Vector3d& point);

// A convention of poses that fits the points where the one that the format demands does not.
struct PoseConvention {
  std::string name;       // "OpenCV's camera axes (x right, y down, z forward)"
  double seen = 0;        // share of the points that a camera sees, mean over the cameras
  double as_written = 0;  // the same with the poses as the format demands
  Pose (*corrected)(const Pose& as_written) = nullptr;
};

// Returns the convention in which the poses were written, if with it the cameras see at least a
// quarter of the points, and four times as many as with the format's own. Returns nothing
// otherwise, or with fewer than 20 points.
std::optional<PoseConvention> FindConvention(PoseFormat format, std::span<const PosedLens> cameras,
                                             std::span<const ScenePoint> points);

// Returns a warning if the cameras see next to none of the points, or nothing.
std::optional<std::string> WarnOfUnseenPoints(std::span<const PosedLens> cameras,
                                              std::span<const ScenePoint> points);

// Returns a warning if the point that the cameras' optical axes come closest to lies behind at
// least nine tenths of them: they look away from what they were turned to, mostly because of
// another convention of axes. For datasets with too few points for the checks above. Returns
// nothing otherwise, or if the axes are nearly parallel or do not meet.
std::optional<std::string> WarnOfAxesTurnedAway(PoseFormat format,
                                                std::span<const PosedLens> cameras,
                                                std::span<const ScenePoint> points);

// Returns a warning if more than half of the pixels of the views are ignored, or pixels that show
// more than half of the points: masks are often turned round. Returns nothing otherwise.
// `has_ignore_masks`: else only transparent pixels are ignored, and their number does not count.
std::optional<std::string> WarnOfIgnoredScene(const Capture& capture, bool has_ignore_masks);

// Returns a warning if nearly no pixel of the views is brighter than 32 of 255: cameras of 10 to 14
// bits often leave the upper bits of 16-bit files empty. Returns nothing otherwise.
std::optional<std::string> WarnOfDarkPhotographs(const Capture& capture);

// Returns a warning if each view with masks has one that covers more than half of the pixels on
// average: such masks mostly say which pixels to use. Returns nothing otherwise.
std::optional<std::string> WarnOfKeepMasks(const Capture& capture);

}  // namespace pepeseg
