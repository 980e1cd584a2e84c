#pragma once

#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cli/demo_scene.h"
#include "clients/cpp/client.h"
#include "pepeseg/v1/evaluation.pb.h"

namespace pepeseg::client::cli {

// One scale and threshold for all products.
struct FixedQuestion {
  double scale = 0;      // quantile
  double threshold = 0;  // cosine
};

struct ViewScore {
  std::string view;
  bool clicked = false;  // the click was in this view
  double iou = 0;
  Mask mask;
};

// A product by the one-click protocol, and what the fixed question answers.
struct ProductScore {
  Product product;
  v1::EvaluateResponse::Entity scores;
  std::vector<ViewScore> views;  // held out and showing the product; at the fixed question
  double mean_iou = 0;           // of `views`
  double query_seconds = 0;      // the fixed question, as the client sees it
};

struct DemoScores {
  v1::EvaluateResponse evaluation;
  std::vector<ProductScore> products;
};

// A product that fewer than two held-out views show is an error: the scene has all.
absl::StatusOr<DemoScores> ScoreProducts(const Client& client, const std::string& model,
                                         const std::vector<DemoView>& views,
                                         std::span<const Product> products,
                                         const FixedQuestion& fixed);

}  // namespace pepeseg::client::cli
