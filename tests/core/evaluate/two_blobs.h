#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/evaluate/evaluate.h"
#include "core/query/segmenter.h"

namespace pepeseg::testing {

inline constexpr int kTwoBlobsSize = 96;  // pixels, width and height of each view

// Two blobs in front of three held-out views "a", "b" and "c". At large scales the gate hides the
// dimension in which their features differ: their cosine is (0.25 - p^2) / (0.25 + p^2) with p =
// sigmoid(gate_bias - 20 s). At the default bias it is under -0.5 up to scale 0.4, 0 at 0.5, 0.89
// at 0.6, 0.999 at 0.7; a bias of 2 moves all of this 0.4 down.
Model TwoBlobs(float gate_bias = 10);

// Returns the mask that a click on a blob of the default model selects at a small scale.
std::vector<uint8_t> MaskOfBlob(const Segmenter& segmenter, int view, bool left);

// Evaluates masks of entities in the views of TwoBlobs.
class TwoBlobsTest : public ::testing::Test {
 protected:
  using Mask = std::vector<uint8_t>;  // [height, width] of 0 and 1

  // The truth of most tests is masks as the threshold gives them.
  void SetUp() override {
    MakeModel(10);
    options_.refine_borders = false;
  }

  // Makes a new model, whose caches are empty.
  void MakeModel(float gate_bias);

  // The masks of the blobs in a view.
  Mask Left(int view) const { return MaskOfBlob(*segmenter_, view, true); }
  Mask Right(int view) const { return MaskOfBlob(*segmenter_, view, false); }
  Mask Pair(int view) const;
  // Returns rows from the bottom of the image, where nothing is rendered.
  static Mask BottomRows(int num_rows);
  static Mask Union(Mask a, const Mask& b);
  // Returns the number of pixels of a mask.
  static double Area(const Mask& mask);

  // Adds a mask of an entity to the request.
  void Show(int view, const std::string& entity, const Mask& mask) { masks_[view][entity] = mask; }

  EvaluationRequest Request() const;
  absl::StatusOr<EvaluationResult> Run() const;

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<Segmenter> segmenter_;
  std::map<int, std::map<std::string, Mask>> masks_;
  std::vector<EntityPrompt> prompts_;
  Mask ignore_;  // of all views
  EvaluationOptions options_;
};

}  // namespace pepeseg::testing
