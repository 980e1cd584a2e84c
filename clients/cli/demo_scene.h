#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cli/picture.h"
#include "clients/cpp/mask.h"
#include "pepeseg/v1/scene_service.pb.h"

namespace pepeseg::client::cli {

// A held-out view with what is known about it; all of the photograph's size.
struct DemoView {
  std::string name;
  Picture photo;
  GreyPicture labels;  // 0: none of the products
  Mask ignore;         // non-zero: not scored

  Mask TruthOf(int label) const;
};

struct Product {
  int label = 0;  // value in labels/*.png
  std::string name;
};
// The four of the scene that ships with the project.
std::span<const Product> DemoProducts();

// The held-out views of a model, from the data folder's images/, labels/ and ignore_mask.png.
// INVALID_ARGUMENT: none is held out.
absl::StatusOr<std::vector<DemoView>> ReadHeldOut(const std::filesystem::path& data,
                                                  const std::vector<v1::View>& views);

}  // namespace pepeseg::client::cli
