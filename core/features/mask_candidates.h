#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/features/mask_agreement.h"
#include "core/features/reprojection.h"
#include "core/scene/capture.h"

namespace pepeseg {

// A mask of a near view, as it lies in a view.
struct MaskCandidate {
  int near = 0;  // index of the near view in Reprojection::near
  int mask = 0;
  int num_cells = 0;                                        // of this view's grid under it
  std::array<int, Reprojection::kNearViews> known_cells{};  // of these, seen by each near view
  bool lacking = false;                                     // the view has no mask of its surface
};

// Masks of the near views that other views agree with, laid over one view's grid and compared with
// each other and with the view's own masks.
class MaskCandidates {
 public:
  // The arguments need not outlive it. mask_scales: see CompleteMasks.
  MaskCandidates(const Capture& capture, int view, const Reprojection& reprojection,
                 const MaskAgreements& agreements, std::span<const std::vector<float>> mask_scales);

  // Groups of candidates of one surface that the view lacks, one candidate a near view, best
  // supported first: those that CompleteMasks adds.
  std::vector<std::vector<int>> Groups() const;
  const MaskCandidate& at(int candidate) const { return candidates_[candidate]; }

 private:
  // One cell of the view's grid: the patch of its own masks, and the pixels in near views.
  struct Cell {
    uint32_t own_patch = 0;
    Reprojection::Sight sight;
  };

  void List(const Capture& capture, int view, const Reprojection& reprojection,
            const MaskAgreements& agreements, std::span<const std::vector<float>> mask_scales);
  static std::vector<Cell> Cells(const Capture& capture, int view,
                                 const Reprojection& reprojection);
  // Candidates over a cell.
  void ListAt(const Capture& capture, std::span<const int> near, const Cell& cell,
              std::vector<int>& candidates) const;
  void FindLacking(const Capture& capture, int view, std::span<const int> near,
                   std::span<const Cell> cells);
  void CountShared(const Capture& capture, std::span<const int> near, std::span<const Cell> cells);
  float Iou(int lacking, int other) const;
  double Support(int lacking) const;
  std::vector<int> GroupOf(int seed) const;

  size_t num_near_ = 0;
  std::vector<std::vector<int>> number_of_;  // by near view and mask: the candidate, or -1
  std::vector<MaskCandidate> candidates_;
  std::vector<int> shared_;  // [candidates, candidates] cells; only rows of lacking ones
};

}  // namespace pepeseg
