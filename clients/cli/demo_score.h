#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cli/picture.h"
#include "clients/cpp/client.h"
#include "clients/cpp/mask.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

// The scene of `pepeseg demo`, and the scores of a model of it.
namespace pepeseg::client::cli {

// A held-out view with its ground truth, all of it of the photograph's size.
struct DemoView {
  std::string name;
  Picture photo;
  GreyPicture labels;  // Product::label of each pixel; 0: none of the products
  Mask ignore;         // pixels that are not 0 are not scored

  // Returns the mask of a label.
  Mask TruthOf(int label) const;
};

struct Product {
  int label = 0;  // value in labels/*.png
  std::string name;
};
// Returns the four products of the scene that ships with pepeseg.
std::span<const Product> DemoProducts();

// Reads the held-out views among `views` from images/, labels/ and ignore_mask.png of the folder
// `data`. INVALID_ARGUMENT: no view is held out.
absl::StatusOr<std::vector<DemoView>> ReadHeldOut(const std::filesystem::path& data,
                                                  const std::vector<v1::View>& views);

// The scale and threshold at which all products are segmented.
struct FixedGranularity {
  double scale = 0;      // quantile, [0, 1]
  double threshold = 0;  // cosine, [-1, 1]
};

struct ViewScore {
  std::string view;
  bool clicked = false;  // the click was in this view
  double iou = 0;
  Mask mask;
};

// Scores of a product: by the one-click protocol, and at the fixed granularity.
struct ProductScore {
  Product product;
  v1::EvaluateModelResponse::Entity scores;  // by the protocol
  v1::EvaluateModelResponse::Click click;    // of the protocol, in the photograph
  std::vector<ViewScore> views;  // held-out views that show the product, at the fixed granularity
  double mean_iou = 0;           // of `views`
  double query_seconds = 0;      // wall time of the Segment call; 0: there was nothing to click on
};

struct DemoScores {
  v1::EvaluateModelResponse evaluation;
  std::vector<ProductScore> products;
};

// Scores a model. INVALID_ARGUMENT: fewer than two of the held-out views show a product.
absl::StatusOr<DemoScores> ScoreProducts(const Client& client, const std::string& model,
                                         const std::vector<DemoView>& views,
                                         std::span<const Product> products,
                                         const FixedGranularity& fixed);

}  // namespace pepeseg::client::cli
