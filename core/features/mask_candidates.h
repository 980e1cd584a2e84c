#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/features/mask_agreement.h"
#include "core/features/near_views.h"
#include "core/scene/capture.h"

namespace pepeseg {

// A mask of a near view, laid over the grid of this view.
struct MaskCandidate {
  int near = 0;       // index of the near view in Reprojection::near
  int mask = 0;       // of the near view
  int num_cells = 0;  // grid cells of this view under the mask
  // Those of num_cells that each near view sees.
  std::array<int, Reprojection::kNearViews> known_cells{};
  bool lacking = false;  // this view has no mask of the same surface
};

// Finds the masks that a view lacks. Lays those masks of the near views that other views agree with
// over the view's grid, and compares them with the view's own masks and with each other.
class MaskCandidates {
 public:
  // The arguments need not outlive it. view: index in the capture. mask_scales: see CompleteMasks.
  MaskCandidates(const Capture& capture, int view, const Reprojection& reprojection,
                 const MaskAgreements& agreements, std::span<const std::vector<float>> mask_scales);

  // Returns the groups from which CompleteMasks adds masks, best supported first. A group is the
  // candidates of one surface that the view lacks, at most one from each near view.
  std::vector<std::vector<int>> Groups() const;
  const MaskCandidate& at(int candidate) const { return candidates_[candidate]; }

 private:
  // One cell of the view's grid.
  struct Cell {
    uint32_t own_patch = 0;     // mask cell of the view's own masks
    Reprojection::Sight sight;  // pixels of the near views
  };

  // Fills in number_of_ and candidates_, without cells.
  void List(const Capture& capture, int view, const Reprojection& reprojection,
            const MaskAgreements& agreements, std::span<const std::vector<float>> mask_scales);
  // Returns the cells of the view that are not ignored.
  static std::vector<Cell> Cells(const Capture& capture, int view,
                                 const Reprojection& reprojection);
  // Sets `candidates` to those over a cell.
  void ListAt(const Capture& capture, std::span<const int> near, const Cell& cell,
              std::vector<int>& candidates) const;
  // Counts the cells of the candidates and finds those that the view lacks.
  void FindLacking(const Capture& capture, int view, std::span<const int> near,
                   std::span<const Cell> cells);
  // Fills in shared_.
  void CountShared(const Capture& capture, std::span<const int> near, std::span<const Cell> cells);
  // Returns the IoU of a lacking candidate with another candidate.
  float Iou(int lacking, int other) const;
  // Returns the sum of the IoU with the candidates of other near views that are of its surface.
  double Support(int lacking) const;
  // Returns the group of a lacking candidate, itself first. Empty if too few views hold its surface
  // as one mask.
  std::vector<int> GroupOf(int seed) const;

  size_t num_near_ = 0;
  std::vector<std::vector<int>> number_of_;  // by near view and mask: candidate, or -1
  std::vector<MaskCandidate> candidates_;
  // [candidates, candidates] grid cells under both; 0 unless the first is lacking.
  std::vector<int> shared_;
};

}  // namespace pepeseg
