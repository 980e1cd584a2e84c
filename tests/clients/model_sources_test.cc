#include "clients/cli/model_sources.h"

#include <gtest/gtest.h>

namespace pepeseg::client::cli {
namespace {

TEST(SourcesText, ComesInTheOrderOfMaking) {
  v1::Model model;
  EXPECT_EQ(SourcesText(model), "");
  (*model.mutable_sources())["depth"] = "none";
  (*model.mutable_sources())["masks"] = "command sam";
  (*model.mutable_sources())["colours"] = "new";
  (*model.mutable_sources())["poses"] = "COLMAP 3.8";
  EXPECT_EQ(SourcesText(model), "poses COLMAP 3.8, masks command sam, depth none, colours new");
}

TEST(MaskQualityText, SaysWhatTheNumberMeans) {
  v1::Model model;
  EXPECT_EQ(MaskQualityText(model), "");
  (*model.mutable_metrics())["mask_quality"] = 0.789;
  EXPECT_EQ(MaskQualityText(model),
            "mask quality 0.79: how far the masks of different views agree, 0 to 1");
}

}  // namespace
}  // namespace pepeseg::client::cli
