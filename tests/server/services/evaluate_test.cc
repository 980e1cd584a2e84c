#include <chrono>
#include <functional>
#include <thread>

#include "server/api/convert_evaluation.h"
#include "tests/server/services/evaluate_fixture.h"

namespace pepeseg {
namespace {

// Every scale selects the same pixels here, so the choices of the reference and the paper agree.
TEST_F(EvaluateTest, ScoresEveryEntityOnTheViewsOtherThanItsReference) {
  const auto red = static_cast<double>(std::count(right.ids.begin(), right.ids.end(), kRed));
  right.FillRows(0, 2, kRed);  // 192 pixels where nothing is
  const grpc::Status status = Evaluate(Request());
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(answer.model(), "scenes/shelf/models/1");
  EXPECT_TRUE(answer.has_compute());
  ASSERT_EQ(answer.entities_size(), 2);
  const auto& first = answer.entities(0);
  EXPECT_EQ(first.name(), "3") << "an id without a name";
  EXPECT_FALSE(first.missing());
  EXPECT_EQ(first.reference_view(), kLeftView) << "the first by name";
  ASSERT_EQ(first.views_size(), 1);
  EXPECT_EQ(first.views(0).view(), kRightView);
  EXPECT_EQ(first.views(0).num_pixels(), static_cast<int64_t>(red) + 192);
  ASSERT_EQ(first.clicks_size(), 1);
  EXPECT_EQ(left.ids[static_cast<int>(first.clicks(0).y()) * kWidth +
                     static_cast<int>(first.clicks(0).x())],
            kRed);
  // All scales and thresholds score the same: their middle is taken, lower in the threshold.
  EXPECT_EQ(first.reference().scale_quantile(), 0.5);
  EXPECT_EQ(first.reference().threshold(), 0.65);
  const double iou = red / (red + 192);
  EXPECT_NEAR(first.reference().mean().iou(), iou, 1e-12);
  EXPECT_NEAR(first.reference().mean().accuracy(), 1 - 192.0 / (kWidth * kHeight), 1e-12);
  EXPECT_NEAR(first.paper().mean().iou(), iou, 1e-12);
  EXPECT_NEAR(first.automatic().mean().iou(), iou, 1e-12);
  ASSERT_EQ(first.paper().views_size(), 1);
  EXPECT_NEAR(first.paper().views(0).iou(), iou, 1e-12);
  EXPECT_LT(first.reference().mean().boundary_iou(), 1);
  EXPECT_GT(first.reference().mean().boundary_iou(), 0);
  ASSERT_EQ(first.iou_by_scale_size(), 11);
  EXPECT_NEAR(first.iou_by_scale(3), iou, 1e-12);
  EXPECT_EQ(answer.entities(1).name(), "the blue one");
  EXPECT_NEAR(answer.entities(1).reference().mean().iou(), 1, 1e-12);
  EXPECT_NEAR(answer.entities(1).reference().mean().boundary_iou(), 1, 1e-12);
  EXPECT_NEAR(answer.scene().reference().iou(), (1 + iou) / 2, 1e-12);
  EXPECT_NEAR(answer.scene().iou_by_scale(10), (1 + iou) / 2, 1e-12);
  EXPECT_EQ(answer.scene().num_entities(), 2);
  EXPECT_EQ(answer.options().DebugString(), ToProto(EvaluationOptions(), false).DebugString());
}

TEST_F(EvaluateTest, TakesOptionsAndIgnoreMasks) {
  right.FillRows(0, 2, kRed);
  right.FillRows(60, 64, 5);  // in one view only
  auto request = Request();
  TruthLabels ignore;
  ignore.FillRows(0, 2, 1);
  request.mutable_views(0)->set_ignore_png(ignore.Png());
  request.mutable_options()->add_scales(0.25);
  request.mutable_options()->set_fixed_threshold(0.6);
  request.mutable_options()->mutable_clicks()->set_max_clicks(7);
  const grpc::Status status = Evaluate(request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_NEAR(answer.scene().reference().iou(), 1, 1e-12);
  ASSERT_EQ(answer.scene().iou_by_scale_size(), 1);
  EXPECT_NEAR(answer.scene().iou_by_scale(0), 1, 1e-12);
  EXPECT_EQ(answer.options().scales_size(), 1);
  EXPECT_EQ(answer.options().scales(0), 0.25);
  EXPECT_EQ(answer.options().fixed_threshold(), 0.6);
  EXPECT_FALSE(answer.options().score_reference());
  EXPECT_TRUE(answer.options().refine_borders());
  EXPECT_EQ(answer.options().thresholds_size(), 10);
  EXPECT_EQ(answer.options().clicks().max_clicks(), 7);
  EXPECT_EQ(answer.options().promptable().min_cosine(), 0.9);
  ASSERT_EQ(answer.left_out_size(), 1);
  EXPECT_EQ(answer.left_out(0), "5");
  request.mutable_options()->set_score_reference(true);
  ASSERT_TRUE(Evaluate(request).ok());
  ASSERT_EQ(answer.entities_size(), 3);
  EXPECT_EQ(answer.entities(0).views_size(), 2);
  EXPECT_EQ(answer.entities(1).name(), "5");
  EXPECT_TRUE(answer.options().score_reference());
}

// The masks of this model are exact already: the option is passed on, and moves no border here.
TEST_F(EvaluateTest, RefinesNoBordersOnRequest) {
  auto request = Request();
  request.mutable_options()->set_refine_borders(false);
  const grpc::Status status = Evaluate(request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_FALSE(answer.options().refine_borders());
  EXPECT_GT(answer.scene().reference().iou(), 0.95);
}

// 16-bit ids: the id of the blue square is over 255, so the void label is named.
TEST_F(EvaluateTest, SaysHowManyVoidPixelsWereLeftOut) {
  right.FillRows(0, 2, 9);
  left.FillRows(0, 3, 9);
  auto request = Request();
  ASSERT_TRUE(Evaluate(request).ok());
  EXPECT_EQ(answer.num_void_pixels(), 0);
  const int num_entities = answer.entities_size() + answer.left_out_size();
  request.set_ignore_label(9);
  const grpc::Status status = Evaluate(request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(answer.num_void_pixels(), 5 * kWidth);
  EXPECT_EQ(answer.entities_size() + answer.left_out_size(), num_entities - 1);
}

TEST_F(EvaluateTest, ScoresAClickOnNothingAsZero) {
  left.FillRows(58, 64, 9);
  right.FillRows(58, 64, 9);
  const grpc::Status status = Evaluate(Request());
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_EQ(answer.entities_size(), 3);
  EXPECT_EQ(answer.entities(1).name(), "of nothing");
  EXPECT_TRUE(answer.entities(1).missing());
  EXPECT_EQ(answer.entities(1).reference().mean().iou(), 0);
  EXPECT_NEAR(answer.scene().reference().iou(), 2.0 / 3, 1e-12);
}

TEST_F(EvaluateTest, ScoresMasksThatOverlapAndJoinsThemByCategory) {
  auto request = MaskRequest();
  for (int v = 0; v < 2; ++v) {
    TruthLabels both = v == 0 ? left : right;
    for (uint16_t& id : both.ids) id = id != 0 ? 1 : 0;
    AddMask("pair", both.MaskOf(1), *request.mutable_views(v));
    AddMask("empty", TruthLabels().MaskOf(1), *request.mutable_views(v));
  }
  v1::Prompt& prompt = AddPrompt(request, "pair");
  SetPoint(30, 32, *prompt.mutable_points());
  SetPoint(66, 32, *prompt.mutable_points());
  const grpc::Status status = Evaluate(request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_EQ(answer.entities_size(), 3) << "an empty mask shows nothing";
  EXPECT_EQ(answer.entities(0).name(), "pair");
  EXPECT_EQ(answer.entities(0).clicks_size(), 0);
  EXPECT_NEAR(answer.entities(0).reference().mean().iou(), 1, 1e-12);
  ASSERT_EQ(answer.categories_size(), 2);
  EXPECT_EQ(answer.categories(1).name(), "square");
  EXPECT_EQ(answer.categories(1).num_entities(), 2);
  EXPECT_NEAR(answer.categories(1).automatic().iou(), 1, 1e-12);
}

TEST_F(EvaluateTest, FindsAnEntityByEachKindOfPrompt) {
  v1::CreateLabelRequest label;
  label.set_parent("scenes/shelf");
  label.set_label_id("red");
  label.mutable_label()->set_view(kRightView);
  label.mutable_label()->mutable_mask()->set_png(right.MaskOf(kRed));
  ASSERT_OK(running.Call(&LabelStub::CreateLabel, label).status());
  // The reference view has no truth: a choice on it needs a mask in the prompt.
  const auto expect_found = [&](const std::function<void(v1::Prompt&)>& set, bool with_reference) {
    auto request = MaskRequest();
    request.mutable_views(1)->clear_masks();
    request.mutable_views(0)->mutable_masks()->RemoveLast();
    request.mutable_options()->set_refine_borders(false);
    v1::Prompt& prompt = AddPrompt(request);
    set(prompt);
    SCOPED_TRACE(prompt.ShortDebugString().substr(0, 90));
    const grpc::Status status = Evaluate(request);
    ASSERT_TRUE(status.ok()) << status.error_message();
    ASSERT_EQ(answer.entities_size(), 1);
    EXPECT_EQ(answer.entities(0).reference_view(), kRightView);
    EXPECT_EQ(answer.entities(0).views(0).view(), kLeftView);
    EXPECT_NEAR(answer.entities(0).paper().mean().iou(), 1, 1e-12);
    EXPECT_NEAR(answer.entities(0).automatic().mean().iou(), 1, 1e-12);
    EXPECT_EQ(answer.entities(0).has_reference(), with_reference);
    EXPECT_EQ(answer.scene().has_reference(), with_reference);
  };
  expect_found([](auto& prompt) { SetPoint(27, 32, *prompt.mutable_points()); }, false);
  expect_found([](auto& prompt) { SetPoint(27, 32, *prompt.mutable_point_mean()); }, false);
  expect_found(
      [](auto& prompt) {
        auto& stroke = *prompt.mutable_scribbles()->add_strokes();
        for (const double x : {22, 32}) {
          auto& vertex = *stroke.add_path();
          vertex.set_x(x);
          vertex.set_y(32);
        }
      },
      false);
  expect_found(
      [&](auto& prompt) {
        prompt.mutable_scribbles()->mutable_positive()->set_png(right.MaskOf(kRed));
        prompt.mutable_scribbles()->mutable_negative()->set_png(right.MaskOf(kBlue));
      },
      true);
  expect_found(
      [](auto& prompt) {
        prompt.mutable_box()->set_x(10);
        prompt.mutable_box()->set_y(15);
        prompt.mutable_box()->set_width(34);
        prompt.mutable_box()->set_height(34);
      },
      false);
  expect_found([&](auto& prompt) { prompt.mutable_mask()->set_png(right.MaskOf(kRed)); }, true);
  expect_found(
      [](auto& prompt) {
        prompt.clear_view();
        prompt.set_label("red");
      },
      true);
}

TEST_F(EvaluateTest, PropagatesLabelsAndMatchesMeanFeatures) {
  for (const auto protocol :
       {v1::EVALUATION_PROTOCOL_LABEL_PROPAGATION, v1::EVALUATION_PROTOCOL_LABEL_PROPAGATION_PIXELS,
        v1::EVALUATION_PROTOCOL_PROMPTABLE}) {
    SCOPED_TRACE(v1::EvaluationProtocol_Name(protocol));
    auto request = MaskRequest();
    request.mutable_options()->set_protocol(protocol);
    (*request.mutable_own_masks())["square.1"] = kRightView;
    const grpc::Status status = Evaluate(request);
    ASSERT_TRUE(status.ok()) << status.error_message();
    ASSERT_EQ(answer.entities_size(), 2);
    EXPECT_EQ(answer.entities(0).reference_view(), kRightView);
    EXPECT_EQ(answer.entities(1).reference_view(), kLeftView);
    EXPECT_NEAR(answer.scene().reference().iou(), 1, 1e-12);
    EXPECT_NEAR(answer.scene().automatic().iou(), 1, 1e-12);
    EXPECT_NEAR(answer.scene().iou_by_scale(0), 1, 1e-12);
    const bool is_mean = protocol == v1::EVALUATION_PROTOCOL_PROMPTABLE;
    EXPECT_EQ(answer.entities(0).paper().threshold(), is_mean ? 0.9 : 0.7);
    EXPECT_EQ(answer.options().protocol(), protocol);
  }
}

TEST_F(EvaluateTest, CountsClicks) {
  right.FillRows(0, 2, kRed);
  auto request = MaskRequest();
  request.mutable_options()->set_protocol(v1::EVALUATION_PROTOCOL_CLICKS);
  request.mutable_options()->mutable_clicks()->set_min_iou(0.95);
  const grpc::Status status = Evaluate(request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_EQ(answer.entities_size(), 2);
  const auto& first = answer.entities(0);
  EXPECT_TRUE(first.reached());
  EXPECT_EQ(first.num_clicks(), 1);
  ASSERT_GE(first.clicks_size(), 1);
  EXPECT_NEAR(first.clicks(0).reference_iou(), 1, 1e-12);
  EXPECT_LT(first.clicks(0).iou(), 1) << "the scored view has two rows more";
  EXPECT_FALSE(first.has_paper());
  EXPECT_FALSE(first.has_automatic());
  EXPECT_FALSE(answer.scene().has_paper());
  EXPECT_EQ(answer.scene().num_clicks(), 1);
  EXPECT_EQ(answer.scene().reached(), 1);
  ASSERT_EQ(answer.scene().iou_after_size(), 3);
  EXPECT_NEAR(answer.scene().iou_after(0), (first.clicks(0).iou() + 1) / 2, 1e-12);
}

TEST_F(EvaluateTest, AgreesWithSamOnMasksThatCount) {
  v1::EvaluateModelRequest request;
  request.set_model("scenes/shelf/models/live");
  request.mutable_options()->set_protocol(v1::EVALUATION_PROTOCOL_SAM_AGREEMENT);
  v1::SamViewMasks& sam = *request.add_sam_views();
  sam.set_view(kLeftView);
  const auto add = [&](const std::string& png) -> v1::SamViewMasks::SamMask& {
    v1::SamViewMasks::SamMask& mask = *sam.add_masks();
    mask.mutable_mask()->set_png(png);
    return mask;
  };
  add(left.MaskOf(kRed)).set_predicted_iou(0.9);
  add(left.MaskOf(kBlue));  // without scores
  TruthLabels wrong;
  wrong.FillRows(0, 10, 1);
  add(wrong.MaskOf(1)).set_stability(0.5);       // too low
  add(wrong.MaskOf(1)).set_predicted_iou(0.87);  // too low
  add(TruthLabels().MaskOf(1));                  // empty
  const grpc::Status status = Evaluate(request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_TRUE(answer.has_sam_agreement());
  EXPECT_EQ(answer.sam_agreement().num_masks(), 2);
  ASSERT_EQ(answer.sam_agreement().views_size(), 1);
  EXPECT_EQ(answer.sam_agreement().views(0).view(), kLeftView);
  EXPECT_NEAR(answer.sam_agreement().views(0).first_iou(), 1, 1e-12);
  EXPECT_NEAR(answer.sam_agreement().best_iou(), 1, 1e-12);
  EXPECT_EQ(answer.entities_size(), 0);
  EXPECT_FALSE(answer.has_scene());
  request.mutable_options()->mutable_sam_agreement()->set_min_stability(0.5);
  ASSERT_TRUE(Evaluate(request).ok());
  EXPECT_EQ(answer.sam_agreement().num_masks(), 3);
  EXPECT_NEAR(answer.sam_agreement().best_iou(), 2.0 / 3, 1e-12);
  sam.mutable_masks(4)->clear_mask();
  ExpectRefused(request, "sam_views[0].masks[4].mask", "neither RLE nor PNG");
  sam.set_view("middle.jpg");
  ExpectRefused(request, "sam_views[0].view", "was trained on");
  request.clear_sam_views();
  ExpectRefused(request, "sam_views", "allowed are 1..1000");
}

TEST_F(EvaluateTest, EndsAtItsDeadlineAndBlocksNoQuery) {
  auto request = Request();
  for (int i = 0; i < 100; ++i) {  // as long as an evaluation can be made here
    request.mutable_options()->add_scales(0.01 * i);
    request.mutable_options()->add_thresholds(0.01 * i);
  }
  std::vector<grpc::StatusCode> codes(6, grpc::UNKNOWN);
  std::vector<std::thread> threads;
  threads.reserve(codes.size());
  for (grpc::StatusCode& code : codes) {
    threads.emplace_back([&] {
      grpc::ClientContext context;
      context.set_deadline(std::chrono::system_clock::now() + std::chrono::milliseconds(1));
      v1::EvaluateModelResponse response;
      code = running.evaluations->EvaluateModel(&context, request, &response).error_code();
    });
  }
  EXPECT_FALSE(Square(kLeftView, 30).empty());
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(codes, std::vector<grpc::StatusCode>(6, grpc::DEADLINE_EXCEEDED));
  EXPECT_TRUE(Evaluate(Request()).ok());
}

}  // namespace
}  // namespace pepeseg
