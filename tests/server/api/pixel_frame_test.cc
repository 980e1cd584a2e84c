#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <utility>

#include "core/formats/images.h"
#include "core/formats/rle.h"
#include "tests/server/shelf_model.h"

// Requests in pixels of the photograph, 192x128, and of the view, 96x64, at half its size.

namespace pepeseg {
namespace {

constexpr int kPhotographWidth = 192, kPhotographHeight = 128;  // of the photograph

using Pixels = std::vector<uint8_t>;

Pixels PixelsOf(const v1::CocoRle& rle) {
  Pixels pixels(static_cast<size_t>(rle.width()) * rle.height());
  const auto counts = ParseCocoCounts(rle.counts());
  EXPECT_OK(counts);
  const auto inside = PixelsOfRuns(*counts, rle.width(), rle.height());
  EXPECT_OK(inside);
  for (const uint32_t pixel : *inside) pixels[pixel] = 1;
  return pixels;
}

double Iou(const Pixels& a, const Pixels& b) {
  if (a.size() != b.size()) return -1;
  double both = 0, either = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    both += a[i] & b[i];
    either += a[i] | b[i];
  }
  return either == 0 ? 1 : both / either;
}

// `model`: name of the dataset's file, see model_worker.cc.
struct PixelFrameTest : EmptyScene {
  PixelFrameTest() : EmptyScene(PEPESEG_MODEL_WORKER) {}
  static constexpr auto kModel = ShelfModel::kModel;

  // Trains a model, which is then the live one.
  void Train(const std::string& model) { TrainToTheEnd("shelf", model); }
  static v1::SegmentViewsRequest At(double x, double y, v1::PixelFrame frame) {
    auto request = Click<v1::SegmentViewsRequest>(x, y);
    request.set_frame(frame);
    return request;
  }
  Reply<v1::SegmentViewsResponse> Ask(const v1::SegmentViewsRequest& request) const {
    return Call(&SegmentationStub::SegmentViews, request);
  }
  // Returns the answer's only mask.
  v1::SegmentViewsResponse::ViewMask Mask(const v1::SegmentViewsRequest& request) const {
    const v1::SegmentViewsResponse answer = *Ask(request);
    EXPECT_EQ(answer.masks_size(), 1);
    return answer.masks_size() == 1 ? answer.masks(0) : v1::SegmentViewsResponse::ViewMask();
  }
  v1::RenderViewResponse Render(const v1::RenderViewRequest& request) const {
    return *Call(&RenderStub::RenderView, request);
  }
  Image Colors(const v1::RenderViewRequest& request) {
    const auto path = running.folder / "picture.png";
    std::ofstream(path, std::ios::binary) << Render(request).png();
    const auto image = DecodePhoto(path, "picture.png");
    EXPECT_OK(image);
    return image.ok() ? *image : Image();
  }
  static v1::RenderViewRequest Picture(v1::PixelFrame frame) {
    v1::RenderViewRequest request;
    request.set_model(kModel);
    request.mutable_viewpoint()->set_view("middle.jpg");
    request.set_frame(frame);
    return request;
  }
};

TEST_F(PixelFrameTest, ListsTheSizeOfThePhotograph) {
  Train("half.model");
  ASSERT_OK_AND_ASSIGN(const v1::ListViewsResponse response,
                       Call(&SceneStub::ListViews, Under{kModel}));
  EXPECT_EQ(response.views(0).camera().width(), 96);
  EXPECT_EQ(response.views(0).photograph_width(), kPhotographWidth);
  EXPECT_EQ(response.views(0).photograph_height(), kPhotographHeight);
}

TEST_F(PixelFrameTest, CountsPixelsOfThePhotographUnlessAskedOtherwise) {
  for (const char* model : {"half.model", "lens.model"}) {
    SCOPED_TRACE(model);
    Train(model);
    // (60, 64) of the photograph is in the red square, (60, 32) of the view is between the squares.
    const auto in_photograph = Mask(At(60, 64, v1::PIXEL_FRAME_UNSPECIFIED));
    EXPECT_EQ(in_photograph.rle().width(), kPhotographWidth);
    EXPECT_EQ(in_photograph.rle().height(), kPhotographHeight);
    const auto in_view = Mask(At(30, 32, v1::PIXEL_FRAME_VIEW));
    EXPECT_EQ(in_view.rle().width(), 96);
    EXPECT_NEAR(static_cast<double>(in_photograph.area()), 4.0 * in_view.area(),
                0.2 * in_photograph.area());
    EXPECT_EQ(in_photograph.score(), in_view.score());
    const Pixels pixels = PixelsOf(in_photograph.rle());
    EXPECT_EQ(std::count(pixels.begin(), pixels.end(), 1), in_photograph.area());
    EXPECT_NEAR(in_photograph.box().x(), 2 * in_view.box().x(), 8);
    EXPECT_NEAR(in_photograph.box().height(), 2 * in_view.box().height(), 8);
    EXPECT_LT(in_photograph.box().x() + in_photograph.box().width(), 96);
  }
}

TEST_F(PixelFrameTest, TurnsAPhotographUpright) {
  Train("turned.model");
  // Stored (60, 64) of 192x128 is upright (128 - 64, 60) of 128x192.
  const auto mask = Mask(At(64, 60, v1::PIXEL_FRAME_PHOTOGRAPH));
  EXPECT_EQ(mask.rle().width(), kPhotographHeight);
  EXPECT_EQ(mask.rle().height(), kPhotographWidth);
  EXPECT_LT(mask.box().y() + mask.box().height(), 96);
  const v1::RenderViewResponse picture = Render(Picture(v1::PIXEL_FRAME_PHOTOGRAPH));
  EXPECT_EQ(picture.width(), kPhotographHeight);
  EXPECT_EQ(picture.height(), kPhotographWidth);
}

TEST_F(PixelFrameTest, AnswersAnOldModelInPixelsOfItsViews) {
  Train("old.model");
  const auto in_photograph = Mask(At(30, 32, v1::PIXEL_FRAME_PHOTOGRAPH));
  const auto in_view = Mask(At(30, 32, v1::PIXEL_FRAME_VIEW));
  EXPECT_EQ(in_photograph.rle().counts(), in_view.rle().counts());
  EXPECT_EQ(in_photograph.rle().width(), 96);
}

TEST_F(PixelFrameTest, NamesFrameAndSizeOfAPointOutside) {
  Train("half.model");
  grpc::Status status = Ask(At(700, 64, v1::PIXEL_FRAME_PHOTOGRAPH));
  EXPECT_ERROR(status, grpc::INVALID_ARGUMENT);
  EXPECT_EQ(status.error_message(), "point 700,64 is outside photograph \"middle.jpg\" (192x128)");
  EXPECT_EQ(DetailOf(status).field(), "prompt.points.points[0]");
  status = Ask(At(100, 32, v1::PIXEL_FRAME_VIEW));
  EXPECT_EQ(status.error_message(), "point 100,32 is outside view \"middle.jpg\" (96x64)");
  v1::SegmentViewsRequest request = At(1, 1, v1::PIXEL_FRAME_VIEW);
  request.set_frame(static_cast<v1::PixelFrame>(7));
  EXPECT_ERROR(Ask(request), grpc::INVALID_ARGUMENT, "frame");
}

TEST_F(PixelFrameTest, RefusesAPointThatTheViewDoesNotShow) {
  Train("lens.model");
  EXPECT_ERROR(Ask(At(1, 1, v1::PIXEL_FRAME_PHOTOGRAPH)), grpc::INVALID_ARGUMENT,
               {.reason = "NOTHING_THERE", .message = "not trained on"});
}

TEST_F(PixelFrameTest, AcceptsBoxesAndMasksOfThePhotograph) {
  Train("lens.model");
  const auto found = Mask(At(60, 64, v1::PIXEL_FRAME_PHOTOGRAPH));
  const Pixels click = PixelsOf(found.rle());
  v1::SegmentViewsRequest request = At(60, 64, v1::PIXEL_FRAME_PHOTOGRAPH);
  v1::BoxPrompt& box = *request.mutable_prompt()->mutable_box();
  box.set_x(found.box().x() - 2), box.set_y(found.box().y() - 2);
  box.set_width(found.box().width() + 4), box.set_height(found.box().height() + 4);
  EXPECT_GT(Iou(PixelsOf(Mask(request).rle()), click), 0.95);
  *request.mutable_prompt()->mutable_mask()->mutable_rle() = found.rle();
  EXPECT_GT(Iou(PixelsOf(Mask(request).rle()), click), 0.95);
  // A mask of the view's size is refused with both sizes and a remedy.
  request.mutable_prompt()->mutable_mask()->mutable_rle()->set_width(96);
  request.mutable_prompt()->mutable_mask()->mutable_rle()->set_height(64);
  const grpc::Status status = Ask(request);
  EXPECT_ERROR(status, grpc::INVALID_ARGUMENT, {.message = "'96x64'"});
  EXPECT_NE(status.error_message().find("192x128"), std::string::npos) << status.error_message();
  EXPECT_NE(status.error_message().find("PIXEL_FRAME_VIEW"), std::string::npos);
}

TEST_F(PixelFrameTest, AnswersSimilarityAndProposalsInTheFrame) {
  Train("half.model");
  v1::SegmentViewsRequest request = At(60, 64, v1::PIXEL_FRAME_PHOTOGRAPH);
  request.set_want_similarity(true);
  const auto mask = Mask(request);
  EXPECT_EQ(mask.similarity().width(), kPhotographWidth);
  EXPECT_EQ(mask.similarity().values().size(), size_t{2} * kPhotographWidth * kPhotographHeight);
  v1::ProposeScalesRequest propose;
  propose.set_model(kModel);
  *propose.mutable_prompt() = request.prompt();
  ASSERT_OK_AND_ASSIGN(const v1::ProposeScalesResponse proposals,
                       Call(&SegmentationStub::ProposeScales, propose));
  ASSERT_GT(proposals.proposals_size(), 0);
  EXPECT_EQ(proposals.proposals(0).mask().rle().width(), kPhotographWidth);
  EXPECT_EQ(proposals.proposals(0).mask().rle().counts(), mask.rle().counts());
}

TEST_F(PixelFrameTest, SelectsTheSameInBothFrames) {
  Train("half.model");
  const auto select = [&](const v1::SegmentViewsRequest& like) {
    v1::CreateSelectionRequest request;
    request.set_model(kModel);
    *request.mutable_prompt() = like.prompt();
    request.set_frame(like.frame());
    return Call(&SelectionStub::CreateSelection, request)->num_gaussians();
  };
  const int64_t in_photograph = select(At(60, 64, v1::PIXEL_FRAME_PHOTOGRAPH));
  EXPECT_EQ(in_photograph, select(At(30, 32, v1::PIXEL_FRAME_VIEW)));
  EXPECT_GT(in_photograph, 8000);
}

TEST_F(PixelFrameTest, ReturnsALabelAsItWasGiven) {
  Train("lens.model");
  const v1::SegmentViewsResponse::ViewMask mask = Mask(At(60, 64, v1::PIXEL_FRAME_PHOTOGRAPH));
  v1::CreateLabelRequest request;
  request.set_parent("scenes/shelf");
  request.set_label_id("red");
  request.set_request_id("once");
  request.mutable_label()->set_view("middle.jpg");
  *request.mutable_label()->mutable_mask()->mutable_rle() = mask.rle();
  for (int i = 0; i < 2; ++i) {  // and a retry
    ASSERT_OK_AND_ASSIGN(const v1::Label label, Call(&LabelStub::CreateLabel, request));
    EXPECT_EQ(label.mask().rle().SerializeAsString(), mask.rle().SerializeAsString());
    EXPECT_EQ(label.area(), mask.area());
  }
  const auto get = [&](v1::PixelFrame frame) {
    v1::GetLabelRequest named;
    named.set_name("scenes/shelf/labels/red");
    named.set_frame(frame);
    const v1::Label label = *Call(&LabelStub::GetLabel, named);
    EXPECT_EQ(label.area(), mask.area()) << "as it was given";
    return label.mask().rle();
  };
  EXPECT_GT(Iou(PixelsOf(get(v1::PIXEL_FRAME_PHOTOGRAPH)), PixelsOf(mask.rle())), 0.95);
  EXPECT_EQ(get(v1::PIXEL_FRAME_UNSPECIFIED).width(), kPhotographWidth);
  const v1::CocoRle in_view = get(v1::PIXEL_FRAME_VIEW);
  EXPECT_EQ(in_view.width(), 96);
  EXPECT_GT(Iou(PixelsOf(in_view), PixelsOf(Mask(At(30, 32, v1::PIXEL_FRAME_VIEW)).rle())), 0.9);
  v1::SegmentViewsRequest by_label;
  by_label.set_model(kModel);
  by_label.mutable_prompt()->set_label("red");
  EXPECT_GT(Iou(PixelsOf(Mask(by_label).rle()), PixelsOf(mask.rle())), 0.95);
  by_label.set_frame(v1::PIXEL_FRAME_VIEW);
  EXPECT_EQ(Mask(by_label).rle().width(), 96);
  request.set_label_id("outside");
  request.set_request_id("");
  request.mutable_label()->mutable_mask()->mutable_rle()->set_counts(
      EncodeCocoRle({[] {
                      Pixels corner(kPhotographWidth * kPhotographHeight);
                      corner[0] = 1;
                      return corner;
                    }()},
                    kPhotographWidth, kPhotographHeight));
  EXPECT_ERROR(Call(&LabelStub::CreateLabel, request), grpc::INVALID_ARGUMENT,
               {.message = "no pixel of the mask"});
}

TEST_F(PixelFrameTest, RendersWhereTheMasksAre) {
  for (const char* model : {"half.model", "lens.model"}) {
    SCOPED_TRACE(model);
    Train(model);
    const Pixels mask = PixelsOf(Mask(At(60, 64, v1::PIXEL_FRAME_PHOTOGRAPH)).rle());
    const Image image = Colors(Picture(v1::PIXEL_FRAME_PHOTOGRAPH));
    ASSERT_EQ(image.width, kPhotographWidth);
    ASSERT_EQ(image.height, kPhotographHeight);
    Pixels red;
    for (size_t i = 0; i < mask.size(); ++i) red.push_back(image.pixels[3 * i] > 128 ? 1 : 0);
    EXPECT_GT(Iou(mask, red), 0.9);
    EXPECT_EQ(Colors(Picture(v1::PIXEL_FRAME_VIEW)).width, 96);
    v1::RenderViewRequest small = Picture(v1::PIXEL_FRAME_PHOTOGRAPH);
    small.set_max_side(48);
    EXPECT_EQ(Colors(small).width, 48);
    EXPECT_EQ(Colors(small).height, 32);
    small.set_max_side(4000);  // nothing is enlarged
    EXPECT_EQ(Colors(small).width, kPhotographWidth);
    for (const auto content :
         {v1::RenderViewRequest::CONTENT_DEPTH, v1::RenderViewRequest::CONTENT_SEGMENTS,
          v1::RenderViewRequest::CONTENT_FEATURES}) {
      v1::RenderViewRequest request = Picture(v1::PIXEL_FRAME_PHOTOGRAPH);
      request.set_content(content);
      const v1::RenderViewResponse picture = Render(request);
      EXPECT_EQ(picture.width(), kPhotographWidth) << content;
      EXPECT_EQ(picture.height(), kPhotographHeight) << content;
    }
  }
}

TEST_F(PixelFrameTest, DrawsOverlaysOfTheFramesSizeOrOfTheAnswers) {
  Train("lens.model");
  const v1::CocoRle mask = Mask(At(60, 64, v1::PIXEL_FRAME_PHOTOGRAPH)).rle();
  v1::RenderViewRequest request = Picture(v1::PIXEL_FRAME_PHOTOGRAPH);
  request.set_max_side(96);
  *request.mutable_overlay_mask()->mutable_rle() = mask;
  const Image of_frame = Colors(request);
  v1::CocoRle& small = *request.mutable_overlay_mask()->mutable_rle();
  Pixels shrunk;
  const Pixels pixels = PixelsOf(mask);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 96; ++x)
      shrunk.push_back(pixels[(2 * y + 1) * kPhotographWidth + 2 * x + 1]);
  }
  small.set_width(96);
  small.set_height(64);
  small.set_counts(EncodeCocoRle({shrunk}, 96, 64));
  EXPECT_EQ(Colors(request).pixels, of_frame.pixels);
  small.set_width(95);
  EXPECT_ERROR(Call(&RenderStub::RenderView, request), grpc::INVALID_ARGUMENT);
  // A subset is drawn where it is seen.
  request.mutable_overlay_subset()->mutable_segment()->set_id(1);
  request.set_max_side(0);
  const Image image = Colors(request);
  const Image plain = Colors(Picture(v1::PIXEL_FRAME_PHOTOGRAPH));
  Pixels changed;
  for (size_t i = 0; i < pixels.size(); ++i) {
    changed.push_back(image.pixels[3 * i + 1] != plain.pixels[3 * i + 1] ? 1 : 0);
  }
  EXPECT_GT(Iou(changed, pixels), 0.9);
}

TEST_F(PixelFrameTest, EvaluatesLabelsOfThePhotographs) {
  for (const char* model : {"half.model", "lens.model"}) {
    SCOPED_TRACE(model);
    Train(model);
    v1::EvaluateModelRequest request;
    request.set_model(kModel);
    for (const char* view : {"left/0.jpg", "right.jpg"}) {
      v1::SegmentViewsRequest ask = At(60, 64, v1::PIXEL_FRAME_PHOTOGRAPH);
      ask.mutable_prompt()->mutable_view()->set_view(view);
      Image labels{kPhotographWidth, kPhotographHeight, 1, PixelsOf(Mask(ask).rle())};
      for (uint8_t& pixel : labels.pixels) pixel = pixel != 0 ? 7 : 0;
      v1::ViewTruth& truth = *request.add_views();
      truth.set_view(view);
      truth.set_labels_png(*EncodePng(labels));
      Image ignore{kPhotographWidth, kPhotographHeight, 1,
                   Pixels(kPhotographWidth * kPhotographHeight)};
      ignore.pixels[0] = 255;
      truth.set_ignore_png(*EncodePng(ignore));
    }
    ASSERT_OK_AND_ASSIGN(const v1::EvaluateModelResponse scores,
                         Call(&EvaluationStub::EvaluateModel, request));
    ASSERT_EQ(scores.entities_size(), 1);
    EXPECT_EQ(scores.entities(0).name(), "7");
    EXPECT_GT(scores.scene().reference().iou(), 0.95);
    // The click is in the photograph's pixels, so it can be used in a request.
    const double x = scores.entities(0).clicks(0).x(), y = scores.entities(0).clicks(0).y();
    v1::SegmentViewsRequest again = At(x, y, v1::PIXEL_FRAME_PHOTOGRAPH);
    again.mutable_prompt()->mutable_view()->set_view(scores.entities(0).reference_view());
    const Pixels mask = PixelsOf(Mask(again).rle());
    EXPECT_EQ(mask[static_cast<size_t>(y) * kPhotographWidth + static_cast<size_t>(x)], 1);
    // Labels of the view's size belong to the other frame.
    Image small{96, 64, 1, Pixels(96 * 64, 7)};
    request.mutable_views(0)->set_labels_png(*EncodePng(small));
    EXPECT_ERROR(Call(&EvaluationStub::EvaluateModel, request), grpc::INVALID_ARGUMENT,
                 {.message = "'96x64': pixels; photograph \"left/0.jpg\" has 192x128"});
  }
}

TEST_F(PixelFrameTest, EvaluatesMasksAndPromptsOfThePhotographs) {
  for (const char* model : {"half.model", "lens.model"}) {
    SCOPED_TRACE(model);
    Train(model);
    v1::EvaluateModelRequest request;
    request.set_model(kModel);
    for (const char* view : {"left/0.jpg", "right.jpg"}) {
      v1::SegmentViewsRequest ask = At(60, 64, v1::PIXEL_FRAME_PHOTOGRAPH);
      ask.mutable_prompt()->mutable_view()->set_view(view);
      v1::ViewTruth& truth = *request.add_views();
      truth.set_view(view);
      truth.add_masks()->set_entity("square");
      *truth.mutable_masks(0)->mutable_mask()->mutable_rle() = Mask(ask).rle();
      v1::SamViewMasks& sam = *request.add_sam_views();
      sam.set_view(view);
      *sam.add_masks()->mutable_mask() = truth.masks(0).mask();
    }
    const auto evaluate = [&] {
      grpc::ClientContext context;
      v1::EvaluateModelResponse scores;
      const grpc::Status status = running.evaluations->EvaluateModel(&context, request, &scores);
      EXPECT_TRUE(status.ok()) << status.error_message();
      return scores;
    };
    v1::Prompt& prompt = (*request.mutable_prompts())["square"];
    prompt.mutable_view()->set_view("right.jpg");
    prompt.mutable_points()->add_points()->set_x(60);  // between the squares in the view
    prompt.mutable_points()->mutable_points(0)->set_y(64);
    EXPECT_GT(evaluate().scene().reference().iou(), 0.95);
    *prompt.mutable_mask() = request.views(1).masks(0).mask();
    EXPECT_GT(evaluate().scene().reference().iou(), 0.95);
    request.clear_prompts();
    request.mutable_options()->set_protocol(v1::EVALUATION_PROTOCOL_SAM_AGREEMENT);
    EXPECT_GT(evaluate().sam_agreement().best_iou(), 0.95);
  }
}

}  // namespace
}  // namespace pepeseg
