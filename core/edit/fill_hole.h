#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/edit/edited_model.h"
#include "core/edit/patches.h"
#include "core/edit/thing_views.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// Removes a thing and fills the hole behind it (METHOD.md section 4, "Edits"), in parts, so that
// progress can be reported in between:
// - What the thing has hidden from all views goes with it: it was not trained on what is there.
// - Flat surfaces that the thing touches are continued (SupportPlane), and its shadow on them is
// lit.
// - What is still open in a view is continued from what is around it there.
// Patches that a view would have seen next to the thing are dropped. Nothing is trained: on
// photographs without the thing, the last steps of stage one's schedule changed nothing that was
// measured (tests/bench/results/edits.md). The same model and thing give the same result on a CPU
// with any number of threads.
class HoleFill {
 public:
  struct Progress {
    const char* activity = "";  // for people
    int64_t num_done = 0, num_all = 0;
  };

  // The segmenter must outlive it. INVALID_ARGUMENT: nothing is to be removed, or nothing would be
  // left.
  static absl::StatusOr<std::unique_ptr<HoleFill>> Create(const Segmenter& segmenter,
                                                          GaussianSet thing);

  bool done() const { return part_ == Part::kDone; }
  // Does the next part of the work. Must not be done. Errors are those of Segmenter::RenderColor.
  // INVALID_ARGUMENT: all that is not the thing is covered by it, so nothing would be left.
  absl::Status Next();
  Progress progress() const;
  // Returns the result. Must be done; call once.
  EditedModel Take() { return std::move(edited_); }

 private:
  enum class Part { kSeen, kShown, kLook, kPlanes, kViews, kDone };

  HoleFill(const Segmenter& segmenter, GaussianSet thing);
  // Adds what the view shows of each Gaussian.
  absl::Status AddShown(const GaussianSet* subset, std::vector<float>& weights);
  // Removes what the thing has covered.
  void RemoveCovered();
  absl::Status FillPlanes();
  void FillViews();
  // Adds those patches that no view would have seen next to the thing.
  void AddHidden(const std::vector<Patch>& patches);
  void AddPatches();

  const Segmenter& segmenter_;
  const std::vector<int64_t> thing_;  // indices of its Gaussians
  const ThingSpace space_;
  const std::vector<ModelView> views_;  // around the thing
  Part part_ = Part::kSeen;
  size_t next_ = 0;  // view of the part
  int round_ = 0;    // of part kShown
  // [num_gaussians] the largest blend weight in a pixel of the views, with the thing and without
  // it.
  std::vector<float> seen_, shown_;
  GaussianSet removed_, rest_;
  std::vector<ThingLook> looks_;  // by view
  std::vector<Patch> patches_;
  std::vector<PlaneFill::Lit> lit_;
  EditedModel edited_;
};

// Returns an upper bound of the host's memory that a fill takes, bytes.
int64_t BytesOfFill(const Model& model);

}  // namespace pepeseg
