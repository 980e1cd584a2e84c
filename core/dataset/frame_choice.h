#pragma once

#include <optional>
#include <set>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "core/dataset/companion_files.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/match_poses.h"
#include "core/dataset/photo_file.h"
#include "core/dataset/photo_poses.h"
#include "core/scene/capture.h"

// Decides which pixel frame (pixel_frame.h) files are of where sizes fit both frames of a
// photograph: EXIF orientations 2 to 4, and 5 to 8 of square photographs. Examines at most
// kMaxExaminedPhotos photographs, evenly spread.
namespace pepeseg {

// Returns the frame of each kind of companion that photographs with an EXIF orientation have: the
// one in which the borders of masks, or the steps of depth, lie on edges of the photographs.
// `facts`: of the photographs that are used. Kinds that are not in `kinds`, or whose content does
// not depend on the frame, are missing. INVALID_ARGUMENT, naming a file: the borders fit both
// frames alike, or a file is malformed.
absl::StatusOr<CompanionFrames> ChooseCompanionFrames(const DatasetIndex& index,
                                                      const PhotoFactsByKey& facts,
                                                      const std::set<Companion>& kinds);

// Returns the frame of depth maps where sizes fit both: the one whose values rank the points as
// their depth or disparity does (depth_checks.h). If one frame shows depth and the other disparity,
// it is the one that the folder is named after. Returns nothing if the points cannot decide.
// `cameras`: what ChooseCameraFrame returned.
absl::StatusOr<std::optional<PixelFrame>> DepthFrameByPoints(
    const DatasetIndex& index, const PhotoPoses& poses, std::span<const Match> matches,
    const PhotoFactsByKey& facts, PixelFrame cameras, std::span<const ScenePoint> points);

// Returns the frame of the cameras where sizes fit both: the one in which photographs have the
// colours of the points where these project. If the points cannot decide, COLMAP's cameras are of
// the stored pixels; a warning of the index says so. INVALID_ARGUMENT: the points cannot decide,
// and the poses are in another format. Poses and points are in the same coordinates.
absl::StatusOr<PixelFrame> ChooseCameraFrame(const PhotoPoses& poses,
                                             std::span<const Match> matches,
                                             const PhotoFactsByKey& facts,
                                             std::span<const ScenePoint> points,
                                             DatasetIndex& index);

}  // namespace pepeseg
