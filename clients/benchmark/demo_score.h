#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cpp/client.h"
#include "clients/cpp/mask.h"
#include "clients/terminal/picture.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "pepeseg/v1/scene_service.pb.h"

// The scene of `pepeseg-benchmark demo`, and the scores of a model of it.
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
  int label = 0;     // value in labels/*.png
  std::string id;    // in report.json, and of the label in the scene
  std::string name;  // for people
};
// Returns the four products of the scene that ships with pepeseg.
std::span<const Product> DemoProducts();

// Reads the held-out views among `views` from images/, labels/ and ignore_mask.png of the folder
// `data`. INVALID_ARGUMENT: no view is held out.
absl::StatusOr<std::vector<DemoView>> ReadHeldOut(const std::filesystem::path& data,
                                                  const std::vector<v1::View>& views);

struct ViewScore {
  std::string view;
  bool clicked = false;  // the click was in this view
  double iou = 0;
  int width = 0, height = 0;  // of the mask
  Mask mask;
};

// The answer to a click: its masks in the held-out views that show the product.
struct DemoAnswer {
  std::string kind;  // "part", "object" or "group"; "": the only proposal, or none
  double scale = 0, threshold = 0;
  std::vector<ViewScore> views;

  double ClickedIou() const;
  double OtherIou() const;  // mean over the other views
};

// The score of one click on a product, as the app asks.
struct ProductScore {
  Product product;
  v1::EvaluateModelResponse::Entity scores;  // by the one-click protocol
  v1::EvaluateModelResponse::Click click;    // of the protocol, in the photograph
  int num_proposals = 0;
  DemoAnswer automatic;      // the proposal that the server prefers
  DemoAnswer chosen;         // of the proposals, the one that fits best in the clicked view
  double query_seconds = 0;  // wall time of the two calls for `automatic`; 0: nothing was clicked
};

// Maximum number of proposals that are chosen from.
inline constexpr int kDemoProposals = 3;

struct DemoScores {
  v1::EvaluateModelResponse evaluation;
  std::vector<ProductScore> products;
};

// Scores a model. INVALID_ARGUMENT: fewer than two of the held-out views show a product.
absl::StatusOr<DemoScores> ScoreProducts(const Client& client, const std::string& model,
                                         const std::vector<DemoView>& views,
                                         std::span<const Product> products);

// Returns the IoU of a mask and the truth over the pixels that are not ignored; 1 if both are
// empty.
double IouOf(const Mask& mask, const Mask& truth, const Mask& ignore);

}  // namespace pepeseg::client::cli
