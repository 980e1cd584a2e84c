#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/sfm/mapper/global_model.h"
#include "core/sfm/mapper/tracks.h"
#include "core/sfm/mapper/view_graph.h"

namespace pepeseg {

// Why a global model is not used.
enum class MapperGate {
  kPassed,
  kTooFew,        // fewer than three photographs are connected
  kTurn,          // the photographs were taken from one spot
  kFocal,         // the pairs do not determine a focal length
  kPositions,     // two seeds led to different positions
  kRegistered,    // photographs that match others lack a pose
  kReprojection,  // features are far from their points
  kPairs,         // pairs disagree with the poses
  kLens,          // a focal length or a distortion that no lens has
  kAngles,        // rays to most points are nearly parallel
  kInFront,       // points are behind cameras
  kFolded,        // photographs should share points by their poses, but do not match; or strong
                  // pairs contradict the poses
};

// Returns a phrase for logs: "photographs from one spot".
std::string_view GateName(MapperGate gate);

// Measurements of the gates. Shares are in [0, 1].
struct ModelMeasures {
  double registered_share = 0;             // of photographs with an edge
  double median_error = 0;                 // of the points' whole tracks, pixels; of a photograph
                                           // over 1000 pixels wide or high: as if shrunk to that
  double error_90 = 0;                     // 0.9 quantile of the same
  double agreeing_pairs = 0;               // of inliers: in pairs with a pose as the model's
  double angle_share = 0;                  // of points: an angle of at least 2 degrees
  double in_front_share = 0;               // of observations of the points' whole tracks
  double matched_share = 0;                // of compared pairs that should share 30 points: are
                                           // edges
  double least_focal = 0, most_focal = 0;  // over the longer side
  int contradicted_pairs = 0;              // strong pairs, of which most inliers disagree
  double most_k1 = 0;                      // largest |k1|
};

// Indices of two photographs, in any order.
using PhotographIndices = std::pair<uint32_t, uint32_t>;

// `edges`: all pairs with a relative pose, whether or not they were used. `tracks`: as built,
// before observations were dropped. `compared`: pairs whose photographs were matched, with or
// without success; empty: all were.
ModelMeasures MeasureModel(std::span<const MapperPhotograph> photographs, const GlobalModel& model,
                           std::span<const ViewEdge> edges, std::span<const Track> tracks,
                           std::span<const PhotographIndices> compared = {});

// Returns the first gate that the measures fail, or kPassed. Every photograph with an edge must be
// registered: COLMAP may do that where this mapper cannot, or find a second place. 85 % of the
// inliers must be in pairs that agree: right models of fox have 0.91 to 0.95, wrong ones at most
// 0.7.
MapperGate JudgeMeasures(const ModelMeasures& measures);

}  // namespace pepeseg
