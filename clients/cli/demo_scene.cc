#include "clients/cli/demo_scene.h"

#include <array>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "clients/cli/pixel_frame.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

absl::StatusOr<DemoView> ReadView(const fs::path& data, const v1::View& view) {
  const auto [width, height] = PhotographSize(view);
  DemoView result;
  result.name = view.view();
  ASSIGN_OR_RETURN(const Picture photo, ReadPicture(data / "images" / view.view()));
  result.photo = Resized(photo, width, height);
  const fs::path label_file = fs::path(view.view()).replace_extension(".png");
  ASSIGN_OR_RETURN(const GreyPicture labels, ReadGreyPicture(data / "labels" / label_file));
  result.labels = Resized(labels, width, height);
  ASSIGN_OR_RETURN(const GreyPicture ignore, ReadGreyPicture(data / "ignore_mask.png"));
  result.ignore = Resized(ignore, width, height).pixels;
  return result;
}

}  // namespace

Mask DemoView::TruthOf(int label) const {
  Mask mask;
  mask.reserve(labels.pixels.size());
  for (const uint8_t value : labels.pixels) mask.push_back(value == label ? 1 : 0);
  return mask;
}

std::span<const Product> DemoProducts() {
  static const std::array<Product, 4> products = {{{48, "creativity_chenille_stems"},
                                                   {114, "i_am_a_bunny_book"},
                                                   {132, "kleenex_tissue_box"},
                                                   {144, "laugh_out_loud_joke_book"}}};
  return products;
}

absl::StatusOr<std::vector<DemoView>> ReadHeldOut(const fs::path& data,
                                                  const std::vector<v1::View>& views) {
  std::vector<DemoView> held_out;
  for (const v1::View& view : views) {
    if (!view.held_out()) continue;
    ASSIGN_OR_RETURN(DemoView read, ReadView(data, view));
    held_out.push_back(std::move(read));
  }
  if (held_out.empty()) {
    return absl::InvalidArgumentError("no view is held out: nothing to score on");
  }
  return held_out;
}

}  // namespace pepeseg::client::cli
