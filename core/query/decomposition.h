#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <list>
#include <mutex>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// The segments of a model at several granularity levels, from fine to coarse. A Gaussian is in at
// most one segment of each level, and a segment lies as a whole in one segment of the next level.
struct Decomposition {
  struct Segment {
    int32_t parent = 0;  // id of the segment of the next level that holds it; 0 on the last level
    int64_t num_gaussians = 0;          // at least 1
    std::array<float, 3> min{}, max{};  // bounding box of the Gaussians' means, scene units
  };
  struct Level {
    double scale = 0;               // query scale, [0, 1]
    std::vector<int32_t> ids;       // [num_gaussians] id of the segment, from 1; 0: in no segment
    std::vector<Segment> segments;  // segments[k] has the id k + 1; largest first
  };
  std::vector<Level> levels;  // by scale, ascending
};

// The default scales: parts, objects, groups.
inline constexpr std::array<double, 3> kDefaultDecompositionScales = {0.01, 0.5, 1};
// The same, and the pieces that the parts are joined from, each split again: small things, such as
// the head of a bolt whose part is the whole bolt.
inline constexpr std::array<double, 4> kPieceDecompositionScales = {0, 0.01, 0.5, 1};
inline constexpr int kMaxLevels = 8;

// Returns INVALID_ARGUMENT unless there are 1 to kMaxLevels scales, all in [0, 1] and ascending
// without repeats; it has a PromptFault.
absl::Status CheckDecompositionScales(std::span<const double> scales);
// Returns INVALID_ARGUMENT unless 0 <= level < levels.size(). The message has the valid range.
absl::Status CheckLevel(const Decomposition& decomposition, int level);
// Returns the Gaussians of a segment. INVALID_ARGUMENT: see CheckLevel, or the level has no segment
// with this id.
absl::StatusOr<GaussianSet> MembersOf(const Decomposition& decomposition, int level, int32_t id);

// Makes a level from the piece of each Gaussian, numbered from 0; -1: in no piece. Segments are
// numbered by the number of their Gaussians, descending; of equal ones the lower piece comes first.
// Parents stay 0.
Decomposition::Level LevelOfPieces(double scale, std::span<const int32_t> pieces,
                                   const Gaussians& gaussians);
// Sets the parents of the segments of `fine`, each of which lies in one segment of `coarse`.
void SetParents(Decomposition::Level& fine, const Decomposition::Level& coarse);

// Cache of the decompositions of a model, by their scales. Each is computed once, even if several
// threads request it at the same time. Keeps the kMostKept most recently used ones. Thread safe:
// one mutex guards the entries, and neither computing nor using a decomposition holds it.
class Decompositions {
 public:
  static constexpr int kMostKept = 4;
  using Make = absl::FunctionRef<absl::StatusOr<Decomposition>()>;
  using Use = absl::FunctionRef<absl::Status(const Decomposition&)>;

  // Calls `use` with the decomposition for `scales`, which stays alive for the call, and returns
  // its status. If it is not cached, calls `make` first; other threads that want the same scales
  // wait, those with other scales do not. An error of `make` is returned to the caller and not
  // cached; the threads that waited then try themselves. Both are called on the calling thread.
  absl::Status With(std::span<const double> scales, Make make, Use use);

 private:
  // A decomposition that is cached, or that a thread is computing (not ready). Entries that are not
  // ready or have users are never dropped, so that references to them stay valid without the mutex.
  struct Entry {
    std::vector<double> scales;
    Decomposition decomposition;
    bool ready = false;
    int num_users = 0;  // calls of `use` that are running
  };
  using Entries = std::list<Entry>;

  // Returns the entry for `scales`, or end(). The mutex must be held.
  Entries::iterator Find(std::span<const double> scales);
  // Returns the entry for `scales`, computing it if needed, and moves it to the front. `lock` must
  // hold the mutex; it is released while `make` runs and while waiting for another thread.
  absl::StatusOr<Entries::iterator> Get(std::span<const double> scales, Make make,
                                        std::unique_lock<std::mutex>& lock);
  // Drops the least recently used entries that can be, down to kMostKept. The mutex must be held.
  void DropOldest();

  std::mutex mutex_;
  std::condition_variable made_;  // a `make` has ended, with or without a result
  Entries entries_;               // most recently used first; guarded by mutex_
};

}  // namespace pepeseg
