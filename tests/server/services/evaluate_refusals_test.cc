#include <cmath>
#include <functional>

#include "core/formats/images.h"
#include "tests/server/services/evaluate_fixture.h"

namespace pepeseg {
namespace {

TEST_F(EvaluateTest, RefusesViewsThatCannotBeScored) {
  auto request = Request();
  request.mutable_views(1)->set_view("nowhere.jpg");
  ExpectRefused(request, "views[1].view", "'nowhere.jpg': not a view of the model");
  request.mutable_views(1)->set_view("middle.jpg");
  ExpectRefused(request, "views[1].view", "'middle.jpg': was trained on");
  request.mutable_options()->set_accept_trained_views(true);
  EXPECT_TRUE(Evaluate(request).ok());
  EXPECT_TRUE(answer.options().accept_trained_views());
  request.mutable_views(1)->set_view(kRightView);
  ExpectRefused(request, "views[1].view", "is given twice");
  request = Request();
  request.clear_views();
  ExpectRefused(request, "views", "allowed are 1..1000");
  while (request.views_size() <= 1000) request.add_views()->set_view(kRightView);
  ExpectRefused(request, "views", "'1001': views; allowed are 1..1000");
  std::fill(left.ids.begin(), left.ids.end(), uint16_t{0});
  ExpectRefused(Request(), "", "no entity has a reference view and shows at least 100 pixels");
}

TEST_F(EvaluateTest, RefusesFilesThatAreNotLabels) {
  const auto expect_refused = [&](const std::string& png, const std::string& words) {
    auto request = Request();
    request.mutable_views(0)->set_labels_png(png);
    ExpectRefused(request, "views[0].labels_png", words);
    request = Request();
    request.mutable_views(1)->set_ignore_png(png);
    ExpectRefused(request, "views[1].ignore_png", words);
    request = MaskRequest();
    request.mutable_views(1)->mutable_masks(0)->mutable_mask()->set_png(png);
    ExpectRefused(request, "views[1].masks[0].mask.png", words);
  };
  expect_refused("labels", "not a whole PNG");
  expect_refused(left.Png().substr(0, left.Png().size() / 2), "not a whole PNG");
  expect_refused(testing::BlackPng(97, 64, 16), "'97x64': pixels; photograph ");
  expect_refused(testing::BlackPng(30'000, 2'000, 1), " has 96x64");
  expect_refused(testing::BlackPng(64, 96, 16), "turn the image by the photograph's EXIF");
  const Image colour{kWidth, kHeight, 3, std::vector<uint8_t>(size_t{3} * kWidth * kHeight)};
  expect_refused(*EncodePng(colour), "has colours, a palette or alpha instead of one grey value");
  expect_refused(*EncodeJpeg({kWidth, kHeight, 1, std::vector<uint8_t>(kWidth * kHeight)}),
                 "not a whole PNG");
}

TEST_F(EvaluateTest, RefusesMasksAndNamesThatDoNotFit) {
  auto request = MaskRequest();
  request.mutable_views(1)->mutable_masks(1)->set_entity("");
  ExpectRefused(request, "views[1].masks[1].entity", "allowed are 1..256");
  request.mutable_views(1)->mutable_masks(1)->set_entity(std::string(257, 'a'));
  ExpectRefused(request, "views[1].masks[1].entity", "'257'");
  request.mutable_views(1)->mutable_masks(1)->set_entity("square.1");
  ExpectRefused(request, "views[1].masks[1]", "entity \"square.1\" has a mask already");
  request = Request();
  (*request.mutable_entity_names())[3] = "";
  ExpectRefused(request, "entity_names[3]", "allowed are 1..256");
  (*request.mutable_entity_names())[3] = "the blue one";
  ExpectRefused(request, "views[0].labels_png", "has a mask already");
  request = Request();
  request.set_frame(static_cast<v1::PixelFrame>(9));
  ExpectRefused(request, "frame", "not a frame of pixels");
}

TEST_F(EvaluateTest, RefusesPromptsThatDoNotFit) {
  const auto expect_refused = [&](const std::function<void(v1::Prompt&)>& set,
                                  const std::string& field, const std::string& words) {
    auto request = MaskRequest();
    set(AddPrompt(request));
    ExpectRefused(request, "prompts[square.1]" + field, words);
  };
  expect_refused([](auto&) {}, "", "no points, box, mask, scribbles, point_mean or label");
  expect_refused([](auto& p) { p.mutable_view()->set_view("nowhere.jpg"); }, ".view.view",
                 "not a view of the model");
  expect_refused(
      [](auto& p) {
        p.mutable_view()->set_view("middle.jpg");
        SetPoint(30, 32, *p.mutable_points());
      },
      ".view", "not a view of the request");
  expect_refused([](auto& p) { p.mutable_points(); }, ".points.points", "0 points");
  expect_refused([](auto& p) { SetPoint(96, 1, *p.mutable_points()); }, ".points.points[0]",
                 "is outside photograph");
  expect_refused(
      [](auto& p) {
        SetPoint(30, 32, *p.mutable_point_mean());
        SetPoint(66, 32, *p.mutable_point_mean());
        p.mutable_point_mean()->mutable_points(1)->set_negative(true);
      },
      ".point_mean.points[1].negative", "positive points only");
  expect_refused([](auto& p) { p.mutable_scribbles(); }, ".scribbles", "no positive stroke");
  expect_refused([](auto& p) { p.mutable_scribbles()->mutable_positive(); }, ".scribbles.positive",
                 "neither RLE nor PNG");
  expect_refused([](auto& p) { p.mutable_box()->set_width(3); }, ".box", "not finite, or is empty");
  expect_refused([](auto& p) { p.mutable_mask()->set_png(TruthLabels().MaskOf(1)); }, ".mask",
                 "no pixel is in the mask");
  auto request = MaskRequest();
  AddPrompt(request, "cup");
  ExpectRefused(request, "prompts[cup]", "no view has a mask");
  request = MaskRequest();
  request.mutable_views(1)->clear_masks();
  (*request.mutable_own_masks())["square.1"] = kRightView;
  ExpectRefused(request, "own_masks[square.1]", "has no mask of the entity");
  (*request.mutable_own_masks())["square.1"] = "middle.jpg";
  ExpectRefused(request, "own_masks[square.1]", "not a view of the request");
  (*request.mutable_own_masks())["cup"] = kRightView;
  ExpectRefused(request, "own_masks[cup]", "no view has a mask");
  request = MaskRequest();
  (*request.mutable_own_masks())["square.1"] = kRightView;
  request.mutable_options()->set_protocol(v1::EVALUATION_PROTOCOL_CLICKS);
  ExpectRefused(request, "prompts", "makes its own");
  request.mutable_options()->clear_protocol();
  SetPoint(30, 32, *AddPrompt(request).mutable_points());
  ExpectRefused(request, "own_masks[square.1]", "has a prompt already");
  request = MaskRequest();
  (*request.mutable_prompts())["square.1"].set_label("none");
  EXPECT_EQ(Evaluate(request).error_code(), grpc::NOT_FOUND);
}

TEST_F(EvaluateTest, RefusesOptionsOutOfRange) {
  const auto expect_refused = [&](const std::function<void(v1::EvaluationOptions&)>& set,
                                  const std::string& field, const std::string& words) {
    auto request = Request();
    set(*request.mutable_options());
    ExpectRefused(request, field, words);
  };
  expect_refused([](auto& o) { o.set_protocol(static_cast<v1::EvaluationProtocol>(99)); },
                 "options.protocol", "not a protocol");
  expect_refused([](auto& o) { o.add_scales(1.5); }, "options.scales[0]",
                 "options.scales[0] is 1.5, must be in [0, 1]");
  expect_refused([](auto& o) { o.add_thresholds(NAN); }, "options.thresholds[0]", "is nan");
  expect_refused(
      [](auto& o) {
        for (int i = 0; i <= 100; ++i) o.add_scales(0.001 * i);
      },
      "options.scales", "options.scales has 101 values");
  expect_refused([](auto& o) { o.set_fixed_threshold(2); }, "options.fixed_threshold", "is 2");
  expect_refused([](auto& o) { o.set_min_pixels(0); }, "options.min_pixels", "is 0");
  expect_refused([](auto& o) { o.mutable_label_propagation()->set_min_cosine(-2); },
                 "options.label_propagation.min_cosine", "is -2");
  expect_refused([](auto& o) { o.mutable_label_propagation()->set_min_inside(0); },
                 "options.label_propagation.min_inside", "is 0");
  expect_refused([](auto& o) { o.mutable_label_propagation()->set_min_covered(1.5); },
                 "options.label_propagation.min_covered", "is 1.5");
  expect_refused([](auto& o) { o.mutable_label_propagation()->set_max_pixels(1); },
                 "options.label_propagation.max_pixels", "is 1");
  expect_refused([](auto& o) { o.mutable_promptable()->set_min_cosine(1.1); },
                 "options.promptable.min_cosine", "is 1.1");
  expect_refused([](auto& o) { o.mutable_promptable()->set_max_points(0); },
                 "options.promptable.max_points", "is 0");
  expect_refused([](auto& o) { o.mutable_clicks()->set_min_iou(0); }, "options.clicks.min_iou",
                 "is 0");
  expect_refused([](auto& o) { o.mutable_clicks()->set_max_clicks(2); },
                 "options.clicks.max_clicks", "is 2");
  expect_refused([](auto& o) { o.mutable_sam_agreement()->set_min_predicted_iou(2); },
                 "options.sam_agreement.min_predicted_iou", "is 2");
  expect_refused([](auto& o) { o.mutable_sam_agreement()->set_min_stability(-1); },
                 "options.sam_agreement.min_stability", "is -1");
  expect_refused([](auto& o) { o.mutable_sam_agreement()->set_min_pixels(0); },
                 "options.sam_agreement.min_pixels", "is 0");
  expect_refused([](auto& o) { o.mutable_sam_agreement()->set_num_proposals(0); },
                 "options.sam_agreement.num_proposals", "is 0");
  auto request = Request();
  request.set_model("scenes/none/models/live");
  EXPECT_EQ(Evaluate(request).error_code(), grpc::NOT_FOUND);
}

}  // namespace
}  // namespace pepeseg
