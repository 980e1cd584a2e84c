#pragma once

#include <condition_variable>
#include <list>
#include <mutex>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/decompose/decomposition.h"
#include "core/render/renderer.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

// Returns the blend rows of some pixels of a view, y * width + x.
using RowsOfPixels =
    absl::FunctionRef<absl::StatusOr<PixelRows>(const ModelView&, std::span<const int32_t>)>;

// Decomposes a model into segments at each scale (METHOD.md section 4, "Decomposition").
//
// HDBSCAN over the gated unit features of up to 16,384 visible Gaussians, at a fine scale, gives
// the smallest pieces. Each Gaussian goes to the piece whose mean is nearest, or to none if that is
// not similar enough. The segments of a granularity level are those of the finer level, or the
// pieces, joined as long as the means of two are similar at the scale of the level; so segments
// nest.
//
// The same model and scales give the same ids. rows: renders blend rows of the model's views.
// Takes the device lock while it clusters. INVALID_ARGUMENT: see CheckDecompositionScales. Other
// errors are those of `rows` and of Hdbscan.
absl::StatusOr<Decomposition> Decompose(Backend& backend, const Model& model,
                                        std::span<const double> scales, RowsOfPixels rows);

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
