#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <functional>
#include <thread>

#include "core/formats/encode_png.h"
#include "core/formats/rle.h"
#include "server/api/evaluation_options.h"
#include "tests/server/shelf_model.h"
#include "tests/testing/png_bytes.h"

namespace pepeseg {
namespace {

constexpr char kLeftView[] = "left/0.jpg", kRightView[] = "right.jpg";  // those held out
constexpr uint16_t kRed = 3, kBlue = 700;

// 16-bit label image of one of the model's views.
struct Labels {
  std::vector<uint16_t> ids = std::vector<uint16_t>(kWidth * kHeight);

  void FillRows(int first, int last, uint16_t id) {
    std::fill(ids.begin() + first * kWidth, ids.begin() + last * kWidth, id);
  }
  // Returns the mask of an id as an 8-bit PNG.
  std::string MaskOf(uint16_t id) const {
    std::string rows;
    for (int i = 0; i < kWidth * kHeight; ++i) {
      if (i % kWidth == 0) rows += '\0';
      rows += ids[i] == id ? '\xff' : '\0';
    }
    return testing::GreyPng(kWidth, kHeight, 8, rows);
  }
  std::string Png() const {
    std::string rows;
    for (int i = 0; i < kWidth * kHeight; ++i) {
      if (i % kWidth == 0) rows += '\0';
      rows += static_cast<char>(ids[i] >> 8);
      rows += static_cast<char>(ids[i] & 0xff);
    }
    return testing::GreyPng(kWidth, kHeight, 16, rows);
  }
};

// A scene with the model of model_worker.cc: a red square and a blue one. Their features have no
// scale and are orthogonal, so that every scale and threshold selects one of them exactly.
struct EvaluateTest : ::testing::Test {
  EvaluateTest() : running(PEPESEG_MODEL_WORKER) {
    running.CreateScene("shelf");
    const v1::Job job = running.Await(running.Train("shelf", "file").name());
    EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.DebugString();
    left = Truth(kLeftView);
    right = Truth(kRightView);
  }

  // The pixels of a square in a view.
  std::vector<uint32_t> Square(const std::string& view, double x) {
    v1::SegmentViewsRequest request;
    request.set_model("scenes/shelf/models/live");
    request.mutable_prompt()->mutable_view()->set_view(view);
    request.mutable_prompt()->mutable_points()->add_points()->set_x(x);
    request.mutable_prompt()->mutable_points()->mutable_points(0)->set_y(32);
    grpc::ClientContext context;
    v1::SegmentViewsResponse segments;
    EXPECT_TRUE(running.segmentation->SegmentViews(&context, request, &segments).ok());
    const auto counts = ParseCocoCounts(segments.masks(0).rle().counts());
    return *PixelsOfRuns(*counts, kWidth, kHeight);
  }
  Labels Truth(const std::string& view) {
    Labels labels;
    for (const uint32_t pixel : Square(view, 30)) labels.ids[pixel] = kRed;
    for (const uint32_t pixel : Square(view, 66)) labels.ids[pixel] = kBlue;
    return labels;
  }
  v1::EvaluateModelRequest Request() const {
    v1::EvaluateModelRequest request;
    request.set_model("scenes/shelf/models/live");
    for (const auto& [view, labels] : {std::pair(kRightView, &right), {kLeftView, &left}}) {
      request.add_views()->set_view(view);
      request.mutable_views(request.views_size() - 1)->set_labels_png(labels->Png());
    }
    (*request.mutable_entity_names())[kBlue] = "the blue one";
    (*request.mutable_entity_names())[9] = "of nothing";
    return request;
  }
  // A request with a mask for each square: "square.1" is red, "square.2" is blue.
  v1::EvaluateModelRequest MaskRequest() const {
    v1::EvaluateModelRequest request;
    request.set_model("scenes/shelf/models/live");
    for (const auto& [view, labels] : {std::pair(kLeftView, &left), {kRightView, &right}}) {
      v1::ViewTruth& truth = *request.add_views();
      truth.set_view(view);
      AddMask("square.1", labels->MaskOf(kRed), truth);
      AddMask("square.2", labels->MaskOf(kBlue), truth);
    }
    return request;
  }
  static void AddMask(const std::string& entity, const std::string& png, v1::ViewTruth& truth) {
    v1::EntityMask& mask = *truth.add_masks();
    mask.set_entity(entity);
    mask.mutable_mask()->set_png(png);
  }
  // Adds a prompt for "square.1" in the right view, to be filled.
  static v1::EntityPrompt& AddPrompt(v1::EvaluateModelRequest& request) {
    v1::EntityPrompt& prompt = *request.add_prompts();
    prompt.set_entity("square.1");
    prompt.set_view(kRightView);
    return prompt;
  }
  grpc::Status Evaluate(const v1::EvaluateModelRequest& request) {
    grpc::ClientContext context;
    answer.Clear();
    return running.evaluations->EvaluateModel(&context, request, &answer);
  }
  void ExpectRefused(const v1::EvaluateModelRequest& request, const std::string& field,
                     const std::string& words) {
    const grpc::Status status = Evaluate(request);
    EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT) << words;
    EXPECT_NE(status.error_message().find(words), std::string::npos) << status.error_message();
    if (field.empty()) return;
    EXPECT_EQ(DetailOf(status).field(), field);
  }

  RunningServer running;
  Labels left, right;
  v1::EvaluateModelResponse answer;
};

void SetPoint(double x, double y, v1::PointsPrompt& points) {
  v1::PointsPrompt::Point& point = *points.add_points();
  point.set_x(x);
  point.set_y(y);
}

// The numbers of EvaluateOneClick: its choice is the reference's, its oracle is the paper's.
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
  EXPECT_EQ(first.reference().scale_quantile(), 0.01);
  EXPECT_EQ(first.reference().threshold(), 0.5);
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
  Labels ignore;
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
    Labels both = v == 0 ? left : right;
    for (uint16_t& id : both.ids) id = id != 0 ? 1 : 0;
    AddMask("pair", both.MaskOf(1), *request.mutable_views(v));
    AddMask("empty", Labels().MaskOf(1), *request.mutable_views(v));
  }
  v1::EntityPrompt& prompt = AddPrompt(request);
  prompt.set_entity("pair");
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
  const auto expect_found = [&](const std::function<void(v1::EntityPrompt&)>& set,
                                bool with_reference) {
    auto request = MaskRequest();
    request.mutable_views(1)->clear_masks();
    request.mutable_views(0)->mutable_masks()->RemoveLast();
    v1::EntityPrompt& prompt = AddPrompt(request);
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
  expect_found([](auto& prompt) { prompt.set_label_id("red"); }, true);
  expect_found(
      [](auto& prompt) {
        prompt.clear_view();
        prompt.set_label_id("red");
      },
      true);
}

TEST_F(EvaluateTest, PropagatesLabelsAndMatchesMeanFeatures) {
  for (const auto protocol :
       {v1::EVALUATION_PROTOCOL_LABEL_PROPAGATION, v1::EVALUATION_PROTOCOL_PROMPTABLE}) {
    SCOPED_TRACE(v1::EvaluationProtocol_Name(protocol));
    auto request = MaskRequest();
    request.mutable_options()->set_protocol(protocol);
    AddPrompt(request).mutable_own_mask();
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
  Labels wrong;
  wrong.FillRows(0, 10, 1);
  add(wrong.MaskOf(1)).set_stability(0.5);       // too low
  add(wrong.MaskOf(1)).set_predicted_iou(0.87);  // too low
  add(Labels().MaskOf(1));                       // empty
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

TEST_F(EvaluateTest, RefusesViewsThatCannotBeScored) {
  auto request = Request();
  request.mutable_views(1)->set_view("nowhere.jpg");
  ExpectRefused(request, "views[1].view", "'nowhere.jpg': no view of the model");
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
  const Image colour{kWidth, kHeight, 3, std::vector<uint8_t>(size_t{3} * kWidth * kHeight)};
  expect_refused(*EncodePng(colour), "has colours instead of one grey value");
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
  const auto expect_refused = [&](const std::function<void(v1::EntityPrompt&)>& set,
                                  const std::string& field, const std::string& words) {
    auto request = MaskRequest();
    set(AddPrompt(request));
    ExpectRefused(request, "prompts[0]" + field, words);
  };
  expect_refused([](auto&) {}, "",
                 "no points, point_mean, scribbles, box, mask, own_mask or label_id");
  expect_refused([](auto& p) { p.set_entity("cup"); }, ".entity", "no view has a mask");
  expect_refused([](auto& p) { p.set_view("middle.jpg"); }, ".view", "no view of the request");
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
  expect_refused([](auto& p) { p.mutable_scribbles(); }, ".scribbles.positive",
                 "neither RLE nor PNG");
  expect_refused([](auto& p) { p.mutable_box()->set_width(3); }, ".box", "not finite, or is empty");
  expect_refused([](auto& p) { p.mutable_mask()->set_png(Labels().MaskOf(1)); }, ".mask",
                 "no pixel is in the mask");
  expect_refused([](auto& p) { p.set_label_id("scenes/shelf/labels/red"); }, ".label_id",
                 "give the id");
  auto request = MaskRequest();
  request.mutable_views(1)->clear_masks();
  AddPrompt(request).mutable_own_mask();
  ExpectRefused(request, "prompts[0].own_mask", "has no mask of the entity");
  request = MaskRequest();
  AddPrompt(request).mutable_own_mask();
  request.mutable_options()->set_protocol(v1::EVALUATION_PROTOCOL_CLICKS);
  ExpectRefused(request, "prompts", "makes its own");
  request.mutable_options()->clear_protocol();
  AddPrompt(request).mutable_own_mask();
  ExpectRefused(request, "prompts[1].entity", "has a prompt already");
  request = MaskRequest();
  AddPrompt(request).set_label_id("none");
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
