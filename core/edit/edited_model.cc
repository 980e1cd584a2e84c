#include "core/edit/edited_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "kernels/gaussian_planes.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

// Returns the features of the Gaussians `rows` of a model, in that order; empty if it has none.
FeatureField FieldOf(const FeatureField& field, std::span<const int64_t> rows) {
  FeatureField selected;
  selected.gate = field.gate;
  selected.scale_quantiles = field.scale_quantiles;
  if (field.empty()) return selected;
  selected.features.reserve(rows.size() * kFeatureSize);
  for (const int64_t row : rows) {
    const auto first = field.features.begin() + row * kFeatureSize;
    selected.features.insert(selected.features.end(), first, first + kFeatureSize);
  }
  if (field.confidence.empty()) return selected;
  selected.confidence.reserve(rows.size());
  for (const int64_t row : rows) selected.confidence.push_back(field.confidence[row]);
  return selected;
}

// Appends Gaussians of the same SH degree.
void Append(const Gaussians& added, Gaussians& gaussians) {
  Gaussians both = Gaussians::Zero(gaussians.count + added.count, gaussians.sh_degree);
  for (int k = 0; k < NumPlanes(gaussians.sh_degree); ++k) {
    const std::span<float> to = both.Plane(k);
    std::ranges::copy(gaussians.Plane(k), to.begin());
    std::ranges::copy(added.Plane(k), to.begin() + gaussians.count);
  }
  gaussians = std::move(both);
}

// Marks the last `num` of `count` Gaussians.
GaussianSet LastOf(int64_t count, int64_t num) {
  GaussianSet set{std::vector<uint8_t>(static_cast<size_t>(count))};
  std::fill(set.member.end() - num, set.member.end(), uint8_t{1});
  return set;
}

}  // namespace

std::vector<int64_t> RowsOf(const GaussianSet& set) {
  std::vector<int64_t> rows;
  for (size_t i = 0; i < set.member.size(); ++i) {
    if (set.member[i] != 0) rows.push_back(static_cast<int64_t>(i));
  }
  return rows;
}

EditedModel RemoveGaussians(const Model& model, const GaussianSet& removed,
                            const NewGaussians& added) {
  std::vector<int64_t> rows;
  for (int64_t i = 0; i < model.gaussians.count; ++i) {
    if (removed.member[i] == 0) rows.push_back(i);
  }
  EditedModel edited;
  edited.gaussians = model.gaussians.Select(rows);
  edited.num_removed = model.gaussians.count - edited.gaussians.count;
  edited.num_added = added.gaussians.count;
  if (edited.num_added > 0) Append(added.gaussians, edited.gaussians);
  rows.insert(rows.end(), added.like.begin(), added.like.end());
  edited.field = FieldOf(model.field, rows);
  edited.touched = LastOf(edited.gaussians.count, edited.num_added);
  return edited;
}

EditedModel MoveMembers(const Model& model, const GaussianSet& set, const Similarity& move,
                        bool copy) {
  const std::vector<int64_t> members = RowsOf(set);
  EditedModel edited;
  if (!copy) {
    edited = {model.gaussians, model.field, set, 0, 0, static_cast<int64_t>(members.size())};
    MoveGaussians(move, members, edited.gaussians);
    return edited;
  }
  NewGaussians moved = {model.gaussians.Select(members), members};
  std::vector<int64_t> all(members.size());
  for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int64_t>(i);
  MoveGaussians(move, all, moved.gaussians);
  const GaussianSet none{std::vector<uint8_t>(set.member.size())};
  return RemoveGaussians(model, none, moved);
}

double ReachOf(const Gaussians& gaussians, const GaussianSet& set) {
  double reach = 0;
  for (const int64_t row : RowsOf(set)) {
    for (int k = 0; k < 3; ++k) {
      const double at = std::abs(double{gaussians.Plane(kMeanPlane + k)[row]});
      const double size = std::exp(double{gaussians.Plane(kLogScalePlane + k)[row]});
      if (!std::isfinite(at + size)) return std::numeric_limits<double>::infinity();
      reach = std::max({reach, at, size});
    }
  }
  return reach;
}

EditedModel RecolorMembers(const Model& model, const GaussianSet& set, const NewColor& color) {
  const std::vector<int64_t> members = RowsOf(set);
  EditedModel edited = {
      model.gaussians, model.field, set, 0, 0, static_cast<int64_t>(members.size())};
  RecolorGaussians(color, members, edited.gaussians);
  return edited;
}

int64_t BytesOfEdit(const Model& model) {
  // A copy takes the most: the members, and both together while they are joined.
  const int64_t of_gaussian = static_cast<int64_t>(sizeof(float)) *
                                  (NumPlanes(model.gaussians.sh_degree) + kFeatureSize + 1) +
                              static_cast<int64_t>(sizeof(int64_t)) * 2 + 1;
  return 4 * model.gaussians.count * of_gaussian;
}

}  // namespace pepeseg
