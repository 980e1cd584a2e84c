#include "clients/cpp/border_requests.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "absl/strings/str_cat.h"

namespace pepeseg::client {
namespace {

using ::testing::ElementsAre;
using Targets = v1::SegmentViewsRequest::Targets;

// Views 0.jpg to 249.jpg; every eighth is held out.
std::vector<v1::View> ManyViews() {
  std::vector<v1::View> views(250);
  for (int i = 0; i < 250; ++i) {
    views[i].set_view(absl::StrCat(i, ".jpg"));
    views[i].set_held_out(i % 8 == 0);
  }
  return views;
}

v1::SegmentViewsRequest RequestOf(Targets::Group group) {
  v1::SegmentViewsRequest request;
  request.set_model("scenes/shelf/models/live");
  request.set_sam_borders(true);
  request.mutable_targets()->set_group(group);
  return request;
}

// Returns the views of all pieces in their order, and checks the size of each piece.
std::vector<std::string> ViewsOf(const std::vector<v1::SegmentViewsRequest>& pieces) {
  std::vector<std::string> names;
  for (const v1::SegmentViewsRequest& piece : pieces) {
    EXPECT_EQ(piece.targets().group(), Targets::GROUP_UNSPECIFIED);
    EXPECT_TRUE(piece.sam_borders());
    EXPECT_EQ(piece.model(), "scenes/shelf/models/live");
    EXPECT_LE(piece.targets().views_size(), 8);
    names.insert(names.end(), piece.targets().views().begin(), piece.targets().views().end());
  }
  return names;
}

TEST(PiecesOf, HaveAllViewsOfAGroupInTheOrderOfTheModel) {
  const std::vector<v1::View> views = ManyViews();
  const std::vector<std::string> all = ViewsOf(PiecesOf(RequestOf(Targets::GROUP_ALL), views));
  ASSERT_EQ(all.size(), 250U);
  for (size_t i = 0; i < all.size(); ++i) EXPECT_EQ(all[i], views[i].view());
  const auto held_out = ViewsOf(PiecesOf(RequestOf(Targets::GROUP_HELD_OUT), views));
  ASSERT_EQ(held_out.size(), 32U);
  EXPECT_EQ(held_out[1], "8.jpg");
}

TEST(PiecesOf, HaveEachNamedViewOnce) {
  v1::SegmentViewsRequest request = RequestOf(Targets::GROUP_UNSPECIFIED);
  for (const int i : {9, 8, 7, 6, 5, 4, 3, 2, 1, 9, 8}) {
    request.mutable_targets()->add_views(absl::StrCat(i, ".jpg"));
  }
  EXPECT_THAT(
      ViewsOf(PiecesOf(request, {})),
      ElementsAre("9.jpg", "8.jpg", "7.jpg", "6.jpg", "5.jpg", "4.jpg", "3.jpg", "2.jpg", "1.jpg"));
}

TEST(PiecesOf, AreTheRequestItselfForFewViews) {
  const v1::SegmentViewsRequest of_prompt = RequestOf(Targets::GROUP_UNSPECIFIED);
  const auto pieces = PiecesOf(of_prompt, {});
  ASSERT_EQ(pieces.size(), 1U);
  EXPECT_EQ(pieces[0].SerializeAsString(), of_prompt.SerializeAsString());
  std::vector<v1::View> views = ManyViews();
  views.resize(8);
  EXPECT_EQ(PiecesOf(RequestOf(Targets::GROUP_ALL), views).size(), 1U);
  views.resize(9);
  EXPECT_EQ(PiecesOf(RequestOf(Targets::GROUP_ALL), views).size(), 2U);
}

TEST(AddPiece, AddsMasksTimesAndTheAgreementWithABox) {
  v1::SegmentViewsResponse whole;
  whole.set_model("scenes/shelf/models/3");
  whole.add_masks()->set_view("a.jpg");
  whole.mutable_timing()->mutable_compute()->set_nanos(700'000'000);
  v1::SegmentViewsResponse piece;
  piece.add_masks()->set_view("b.jpg");
  piece.mutable_timing()->mutable_compute()->set_seconds(1);
  piece.mutable_timing()->mutable_compute()->set_nanos(600'000'000);
  AddPiece(piece, whole);
  EXPECT_FALSE(whole.has_box_agreement());
  piece.set_box_agreement(0.9);
  AddPiece(piece, whole);
  EXPECT_EQ(whole.box_agreement(), 0.9);
  ASSERT_EQ(whole.masks_size(), 3);
  EXPECT_EQ(whole.masks(0).view(), "a.jpg");
  EXPECT_EQ(whole.masks(2).view(), "b.jpg");
  EXPECT_EQ(whole.timing().compute().seconds(), 3);
  EXPECT_EQ(whole.timing().compute().nanos(), 900'000'000);
  EXPECT_EQ(whole.model(), "scenes/shelf/models/3");
}

}  // namespace
}  // namespace pepeseg::client
