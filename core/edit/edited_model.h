#pragma once

#include <cstdint>
#include <vector>

#include "core/edit/move_gaussians.h"
#include "core/edit/recolor_gaussians.h"
#include "core/scene/gaussians.h"
#include "core/scene/model.h"

// Edits of the Gaussians of a model: each makes other Gaussians and their features.

namespace pepeseg {

// Largest number of Gaussians of a model that an edit makes: that of its files.
inline constexpr int64_t kMaxEditedGaussians = 50'000'000;
// Largest coordinate and standard deviation of a Gaussian that a move makes, scene units: float has
// room for what rendering computes with them.
inline constexpr double kMaxMovedReach = 1e9;

struct EditedModel {
  Gaussians gaussians;
  FeatureField field;  // empty where that of the model is
  // The Gaussians that the edit has added, or else changed.
  GaussianSet touched;
  int64_t num_removed = 0, num_added = 0, num_changed = 0;
};

// New Gaussians, and for each one the Gaussian of the model whose feature it gets.
struct NewGaussians {
  Gaussians gaussians;        // of the model's SH degree
  std::vector<int64_t> like;  // [count] indices into the model
};

// Returns the indices of the members, ascending.
std::vector<int64_t> RowsOf(const GaussianSet& set);

// Returns the model without the members of `removed`, and with the added Gaussians at its end.
EditedModel RemoveGaussians(const Model& model, const GaussianSet& removed,
                            const NewGaussians& added);
// Returns the model with its members moved, or with a moved copy of them at its end.
EditedModel MoveMembers(const Model& model, const GaussianSet& set, const Similarity& move,
                        bool copy);
// Returns the largest coordinate or standard deviation of the members, scene units; infinity if one
// is not finite.
double ReachOf(const Gaussians& gaussians, const GaussianSet& set);
// Returns the model with its members in another colour. There must be a member.
EditedModel RecolorMembers(const Model& model, const GaussianSet& set, const NewColor& color);

// Returns an upper bound of the host's memory that an edit without a fill takes, bytes.
int64_t BytesOfEdit(const Model& model);

}  // namespace pepeseg
