#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/formats/rle.h"
#include "server/services/found_to_proto.h"
#include "server/services/seen_models.h"
#include "tests/server/shelf_model.h"
#include "tests/testing/fake_sam.h"
#include "tests/testing/front_blobs.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;

struct FindTest : ShelfModel {
  FindTest() {
    request.set_model(kModel);
    request.set_frame(v1::PIXEL_FRAME_VIEW);
  }
  // Labels the red square, or the blue one.
  void Label(const std::string& id, const std::string& text, bool blue = false) {
    v1::CreateLabelRequest label;
    label.set_parent("scenes/shelf");
    label.set_label_id(id);
    label.mutable_label()->set_text(text);
    label.mutable_label()->set_view("middle.jpg");
    BinaryMask mask = {std::vector<uint8_t>(size_t{kWidth} * kHeight)};
    for (int y = 18; y < 46; ++y) {
      for (int x = 16; x < 44; ++x) mask.pixels[y * kWidth + x + (blue ? 36 : 0)] = 1;
    }
    v1::CocoRle& rle = *label.mutable_label()->mutable_mask()->mutable_rle();
    rle.set_width(kWidth);
    rle.set_height(kHeight);
    rle.set_counts(EncodeCocoRle(mask, kWidth, kHeight));
    EXPECT_OK(Call(&LabelStub::CreateLabel, label));
  }
  Reply<v1::FindSegmentsResponse> Find() const {
    return Call(&SegmentationStub::FindSegments, request);
  }
  Reply<v1::FindSegmentsResponse> FindText(const std::string& text) {
    request.set_text(text);
    return Find();
  }

  v1::FindSegmentsRequest request;
};

TEST_F(FindTest, FindsALabelByItsText) {
  Label("cup", "The red cup");
  Label("book", "blue book", /*blue=*/true);
  ASSERT_OK_AND_ASSIGN(const auto answer, FindText(" red CUPS "));
  EXPECT_EQ(answer.model(), "scenes/shelf/models/1");
  EXPECT_EQ(answer.source(), v1::FindSegmentsResponse::SOURCE_LABELS);
  ASSERT_EQ(answer.found_size(), 1);
  const auto& found = answer.found(0);
  EXPECT_EQ(found.score(), 1);
  EXPECT_EQ(found.word(), "The red cup");
  EXPECT_EQ(found.label(), "scenes/shelf/labels/cup");
  EXPECT_EQ(found.prompt().label(), found.label());
  EXPECT_EQ(found.segment().id(), 1);
  EXPECT_EQ(found.num_gaussians(), 10'000);
  EXPECT_NEAR(found.box().min().x(), -1.1, 1e-5);
  ASSERT_EQ(found.appearances_size(), 3);
  EXPECT_EQ(answer.known_words_size(), 0);
}

TEST_F(FindTest, FindsAllLabelsOfAWord) {
  Label("a", "left mug");
  Label("b", "right mug", /*blue=*/true);
  ASSERT_OK_AND_ASSIGN(const auto answer, FindText("mug"));
  ASSERT_EQ(answer.found_size(), 2);
  EXPECT_EQ(answer.found(0).score(), 0.9);
  request.set_max_results(1);
  ASSERT_OK_AND_ASSIGN(const auto one, FindText("mug"));
  EXPECT_EQ(one.found_size(), 1);
}

TEST_F(FindTest, AnswersNothingWhenUnsure) {
  Label("cup", "The red cup");
  Label("bottle", "", /*blue=*/true);
  ASSERT_OK_AND_ASSIGN(const auto answer, FindText("botle"));
  EXPECT_EQ(answer.found_size(), 0);
  EXPECT_EQ(answer.source(), v1::FindSegmentsResponse::SOURCE_UNSPECIFIED);
  EXPECT_THAT(answer.known_words(), ElementsAre("The red cup", "bottle"));
  EXPECT_THAT(answer.did_you_mean(), ElementsAre("bottle"));
  request.set_min_score(0.95);
  ASSERT_OK_AND_ASSIGN(const auto part, FindText("cup"));
  EXPECT_EQ(part.found_size(), 1) << "its id";
  ASSERT_OK_AND_ASSIGN(const auto unsure, FindText("red"));
  EXPECT_EQ(unsure.found_size(), 0);
  EXPECT_EQ(unsure.best_score(), 0.9);
  EXPECT_EQ(unsure.best_word(), "The red cup");
}

TEST_F(FindTest, KnowsSynonyms) {
  const std::filesystem::path folder = running.folder / "wordnet";
  std::filesystem::create_directory(folder);
  std::ofstream(folder / "data.noun") << "00000000 06 n 02 couch 0 sofa 0 000 | to sit on\n";
  std::ofstream(folder / "index.noun") << "couch n 1 0 1 0 00000000\nsofa n 1 0 1 0 00000000\n";
  Label("couch", "");
  ASSERT_OK_AND_ASSIGN(const auto without, FindText("sofa"));
  EXPECT_EQ(without.found_size(), std::filesystem::exists("/usr/share/wordnet/index.noun") ? 1 : 0);
  running.options.wordnet = folder;
  running.Restart();
  ASSERT_OK_AND_ASSIGN(const auto answer, FindText("sofas"));
  ASSERT_EQ(answer.found_size(), 1);
  EXPECT_EQ(answer.found(0).score(), 0.7);
}

TEST_F(FindTest, RefusesWhatIsNoRequest) {
  EXPECT_ERROR(Find(), grpc::INVALID_ARGUMENT, "text");
  EXPECT_ERROR(FindText(""), grpc::INVALID_ARGUMENT, "text");
  EXPECT_ERROR(FindText(" \n"), grpc::INVALID_ARGUMENT, "text");
  EXPECT_ERROR(FindText(std::string(201, 'a')), grpc::INVALID_ARGUMENT, "text");
  std::string umlauts;
  for (int i = 0; i < 200; ++i) umlauts += "ü";
  EXPECT_OK(FindText(umlauts)) << "200 characters, 400 bytes";
  request.set_max_results(201);
  EXPECT_ERROR(FindText("cup"), grpc::INVALID_ARGUMENT, "max_results");
  request.set_max_results(0);
  request.set_min_score(1.5);
  EXPECT_ERROR(FindText("cup"), grpc::INVALID_ARGUMENT, "min_score");
}

TEST_F(FindTest, SaysThatLikenessTakesSam) {
  *request.mutable_like() = ClickAt(30);
  const auto answer = Find();
  EXPECT_ERROR(answer, grpc::FAILED_PRECONDITION, "");
  EXPECT_THAT(answer.status().error_message(), ::testing::HasSubstr("deploy/sam.sh"));
}

// The server has a fake of SAM, whose features are colours.
struct FindAlikeTest : FindTest {
  FindAlikeTest() {
    const std::filesystem::path sam = running.folder / "sam";
    testing::MakeFakeSam(sam);
    running.options.workers.sam = sam;
    running.Restart();
  }
};

TEST_F(FindAlikeTest, FindsWhatIsClickedAndNotTheOther) {
  for (const bool blue : {false, true}) {
    *request.mutable_like() = ClickAt(blue ? 66 : 30);
    ASSERT_OK_AND_ASSIGN(const auto answer, Find());
    EXPECT_EQ(answer.source(), v1::FindSegmentsResponse::SOURCE_APPEARANCE);
    ASSERT_EQ(answer.found_size(), 1);
    const auto& found = answer.found(0);
    EXPECT_NEAR(found.score(), 1, 1e-4);
    EXPECT_EQ(found.segment().id(), blue ? 2 : 1);
    EXPECT_TRUE(found.word().empty());
  }
}

TEST_F(FindAlikeTest, ReturnsAPromptThatSegmentsTheThing) {
  request.mutable_like_segment()->set_id(1);
  ASSERT_OK_AND_ASSIGN(const auto answer, Find());
  ASSERT_EQ(answer.found_size(), 1);
  v1::SegmentViewsRequest segment;
  segment.set_model(kModel);
  segment.set_frame(v1::PIXEL_FRAME_VIEW);
  *segment.mutable_prompt() = answer.found(0).prompt();
  ASSERT_OK_AND_ASSIGN(const auto shown, Call(&SegmentationStub::SegmentViews, segment));
  const auto& seen = answer.found(0).appearances(0);
  EXPECT_EQ(shown.masks(0).view(), seen.view());
  EXPECT_NEAR(shown.masks(0).box().x(), seen.x(), 2);
  EXPECT_NEAR(shown.masks(0).box().width(), seen.width(), 3);
  EXPECT_NEAR(static_cast<double>(shown.masks(0).area()), static_cast<double>(seen.area()), 100);
}

TEST_F(FindAlikeTest, TakesTheSegmentsOfResults) {
  request.mutable_like_segment()->set_id(1);
  ASSERT_OK_AND_ASSIGN(const auto answer, Find());
  ASSERT_EQ(answer.found_size(), 1);
  EXPECT_THAT(answer.found(0).segment().scales(), ElementsAre(0.01, 0.5, 1));
  EXPECT_EQ(answer.found(0).segment().level(), 0);
  *request.mutable_like_segment() = answer.found(0).segment();
  for (const bool with_pieces : {false, true}) {
    if (with_pieces) {  // the square is one piece
      request.mutable_like_segment()->clear_scales();
      for (const double scale : {0.0, 0.01, 0.5, 1.0}) {
        request.mutable_like_segment()->add_scales(scale);
      }
    }
    ASSERT_OK_AND_ASSIGN(const auto again, Find());
    ASSERT_EQ(again.found_size(), 1);
    EXPECT_EQ(again.found(0).segment().DebugString(), answer.found(0).segment().DebugString());
  }
  request.mutable_like_segment()->set_level(4);
  EXPECT_ERROR(Find(), grpc::INVALID_ARGUMENT, "like_segment.id");
}

TEST(SeenModels, KeepWhatWasAskedLastWithinTheirBytes) {
  const auto backend = MakeCpuBackend(1);
  ModelCache cache(MemoryBudget({int64_t{1} << 30, 0}, /*one_memory=*/true));
  const auto model = [&](int64_t number) {
    ModelCache::Source source;
    source.need = [] { return MemoryBytes{1 << 20, 0}; };
    source.load = [&] { return SceneModel::Create(*backend, testing::PairOfBlobs(48)); };
    auto loaded = cache.Acquire(std::to_string(number), source);
    EXPECT_OK(loaded);
    return ResidentModel{"", *std::move(loaded), {{}, number}};
  };
  const ResidentModel first = model(1), second = model(2);
  const auto wanted = [] { return absl::OkStatus(); };
  SeenModels any;
  ASSERT_OK_AND_ASSIGN(const auto segments, any.Segments(first, wanted));
  const int64_t one = any.bytes();
  EXPECT_EQ(one, segments->Bytes());
  EXPECT_GE(one, int64_t{4} * 4 * 48 * 48) << "four levels of a view";
  SeenModels seen(3 * one / 2);
  ASSERT_OK_AND_ASSIGN(const auto kept, seen.Segments(first, wanted));
  EXPECT_EQ(*seen.Segments(first, wanted), kept);
  ASSERT_OK_AND_ASSIGN(const auto other, seen.Segments(second, wanted));
  EXPECT_EQ(*seen.Segments(second, wanted), other);
  EXPECT_EQ(seen.bytes(), one);
  EXPECT_NE(*seen.Segments(first, wanted), kept) << "it made room for the other";
  SeenModels none(one - 1);
  ASSERT_OK(none.Segments(first, wanted));
  EXPECT_EQ(none.bytes(), 0);
}

TEST(RefOf, NamesPiecesThatNoPartIs) {
  SceneSegments all;
  all.first = {0, 3};
  all.segments.resize(5);
  for (int32_t s = 0; s < 5; ++s) {
    all.segments[s].key = s < 3 ? SegmentKey{0, s + 1} : SegmentKey{1, s - 2};
    all.segments[s].is_piece = s < 3;
    all.segments[s].num_gaussians = s == 3 ? 20 : 10;
    all.segments[s].parent = s >= 3 ? -1 : s == 2 ? 4 : 3;
  }
  const v1::SegmentRef half = RefOf(all, 1), whole = RefOf(all, 2), part = RefOf(all, 3);
  EXPECT_THAT(half.scales(), ElementsAre(0, 0.01, 0.5, 1));
  EXPECT_EQ(half.level(), 0);
  EXPECT_EQ(half.id(), 2);
  EXPECT_THAT(whole.scales(), ElementsAre(0.01, 0.5, 1));
  EXPECT_EQ(whole.level(), 0);
  EXPECT_EQ(whole.id(), 2);
  EXPECT_EQ(part.level(), 0);
  EXPECT_EQ(part.id(), 1);
}

TEST_F(FindAlikeTest, RefusesThingsThatAreNotThere) {
  request.mutable_like()->set_label("none");
  EXPECT_ERROR(Find(), grpc::NOT_FOUND, "");
  *request.mutable_like() = ClickAt(1, 1);
  EXPECT_ERROR(Find(), grpc::INVALID_ARGUMENT, {.reason = "NOTHING_THERE"});
  request.mutable_like_segment()->set_id(3);
  EXPECT_ERROR(Find(), grpc::INVALID_ARGUMENT, "like_segment.id");
  request.mutable_like_segment()->add_scales(0.3);
  EXPECT_ERROR(Find(), grpc::INVALID_ARGUMENT, "like_segment.scales");
}

TEST_F(FindAlikeTest, FindsWhatIsLikeALabel) {
  Label("book", "blue book", /*blue=*/true);
  request.mutable_like()->set_label("book");
  ASSERT_OK_AND_ASSIGN(const auto answer, Find());
  ASSERT_EQ(answer.found_size(), 1);
  EXPECT_EQ(answer.found(0).segment().id(), 2);
}

}  // namespace
}  // namespace pepeseg
