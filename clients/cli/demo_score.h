#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cli/connection.h"
#include "clients/cli/demo_scene.h"

namespace pepeseg::cli {

// One click, in one view, asked at a scale and a threshold.
struct Question {
  std::string model;
  std::string view;
  Pixel click;
  double scale = 0;      // quantile
  double threshold = 0;  // cosine
};

struct ViewScore {
  std::string view;
  bool clicked = false;  // the click was in this view
  double iou = 0;
  Mask mask;
};

// The one-click protocol: the click is the pixel deepest inside the product's label in the first
// held-out view that shows it.
struct ProductScore {
  Product product;
  Pixel click;
  std::vector<ViewScore> views;  // held out and showing the product; at the fixed question
  double mean_iou = 0;           // of `views`
  double query_seconds = 0;      // the fixed question, as the client sees it
  // Beside it: scale and threshold chosen on the clicked view's label and scored on the others.
  double chosen_scale = 0;
  double chosen_threshold = 0;
  double chosen_iou = 0;  // mean over the other views; 0 when there is none
};

struct FixedQuestion {
  double scale = 0;
  double threshold = 0;
};

// A product that no held-out view shows with at least 100 pixels is an error: the scene has all.
absl::StatusOr<ProductScore> ScoreProduct(const Connection& connection, const std::string& model,
                                          const std::vector<DemoView>& views,
                                          const Product& product, const FixedQuestion& fixed);

}  // namespace pepeseg::cli
