// Truth in the stored pixels of photographs with an EXIF orientation.
#include <gmock/gmock.h>

#include "core/dataset/pixel_frame.h"
#include "core/formats/images.h"
#include "tests/server/services/evaluate_fixture.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int kPhotoWidth = 2 * kWidth, kPhotoHeight = 2 * kHeight;  // upright

// Returns a JPEG with an EXIF orientation.
std::string WithOrientation(const std::string& jpeg, int orientation) {
  // An APP1 segment: the length, "Exif", and a little-endian TIFF with one entry.
  std::string exif(
      "\xff\xe1\x00\x22"
      "Exif\0\0"
      "II*\0\x08\0\0\0"
      "\x01\0"
      "\x12\x01\x03\0\x01\0\0\0",
      28);
  exif += static_cast<char>(orientation);
  exif += std::string(7, '\0');
  return jpeg.substr(0, 2) + exif + jpeg.substr(2);
}

// A model whose photographs are twice as large as its views, and show what the model does. The
// import has turned them upright, so that only their files have the orientation.
struct EvaluateFramesTest : EvaluateTest {
  // Trains models/2 with the photographs of both held-out views.
  void TrainWith(int orientation) {
    std::vector<TestFile> files = {{"half.model", "bytes", v1::FILE_KIND_POSES}};
    for (const auto& [view, labels] : {std::pair(kLeftView, &left), {kRightView, &right}}) {
      const Image stored = Upright(Photograph(*labels), InverseOrientation(orientation));
      files.push_back({std::string("images/") + view,
                       WithOrientation(EncodeJpeg(stored, 95).value(), orientation)});
    }
    Train(files);
  }
  void Train(const std::vector<TestFile>& files) {
    v1::TrainSceneRequest train;
    train.set_scene("scenes/shelf");
    train.set_dataset(running.UploadAndSeal("shelf", files));
    grpc::ClientContext context;
    v1::Job job;
    ASSERT_TRUE(running.jobs->TrainScene(&context, train, &job).ok());
    ASSERT_EQ(running.Await(job.name()).state(), v1::JOB_STATE_SUCCEEDED);
  }
  static uint16_t IdAt(const TruthLabels& labels, int x, int y) {
    return labels.ids[y / 2 * kWidth + x / 2];
  }
  static Image Photograph(const TruthLabels& labels) {
    Image image{kPhotoWidth, kPhotoHeight, 3, {}};
    for (int y = 0; y < kPhotoHeight; ++y) {
      for (int x = 0; x < kPhotoWidth; ++x) {
        const uint16_t id = IdAt(labels, x, y);
        for (const int value : {id == kRed ? 240 : 20, 30, id == kBlue ? 240 : 20}) {
          image.pixels.push_back(static_cast<uint8_t>(value));
        }
      }
    }
    return image;
  }
  // Returns 8-bit values of a photograph, turned to the stored pixels: `of_red` where the red
  // square is, `of_blue` where the blue one is.
  static std::string StoredPng(const TruthLabels& labels, int orientation, uint8_t of_red,
                               uint8_t of_blue) {
    std::vector<uint8_t> values;
    for (int y = 0; y < kPhotoHeight; ++y) {
      for (int x = 0; x < kPhotoWidth; ++x) {
        const uint16_t id = IdAt(labels, x, y);
        values.push_back(id == kRed ? of_red : id == kBlue ? of_blue : 0);
      }
    }
    values = Turned(values, kPhotoWidth, kPhotoHeight, InverseOrientation(orientation));
    const int width = orientation >= 5 ? kPhotoHeight : kPhotoWidth;
    std::string rows;
    for (size_t i = 0; i < values.size(); ++i) {
      if (i % width == 0) rows += '\0';
      rows += static_cast<char>(values[i]);
    }
    return testing::GreyPng(width, kPhotoWidth * kPhotoHeight / width, 8, rows);
  }
  // A request with label images of the red square, and a click on it in the upright photograph: the
  // two squares change places when it is turned.
  v1::EvaluateModelRequest Labels(int orientation) const {
    v1::EvaluateModelRequest request;
    request.set_model("scenes/shelf/models/live");
    for (const auto& [view, labels] : {std::pair(kLeftView, &left), {kRightView, &right}}) {
      v1::ViewTruth& truth = *request.add_views();
      truth.set_view(view);
      truth.set_labels_png(StoredPng(*labels, orientation, 3, 0));
    }
    SetPoint(2 * 30, 2 * 32, *AddPrompt(request, "3").mutable_points());
    return request;
  }
  double Iou() const { return answer.scene().automatic().iou(); }
};

TEST_F(EvaluateFramesTest, TurnsLabelsOfTheStoredPixelsAndSaysSo) {
  for (const int orientation : {3, 6}) {
    TrainWith(orientation);
    grpc::Status status = Evaluate(Labels(1));
    ASSERT_TRUE(status.ok()) << status.error_message();
    EXPECT_GT(Iou(), 0.95) << "upright";
    EXPECT_THAT(answer.notes(), IsEmpty());
    status = Evaluate(Labels(orientation));
    ASSERT_TRUE(status.ok()) << status.error_message();
    EXPECT_GT(Iou(), 0.95) << orientation;
    EXPECT_THAT(answer.notes(), ElementsAre(HasSubstr("turned upright: left/0.jpg, right.jpg")))
        << orientation;
  }
}

TEST_F(EvaluateFramesTest, TurnsPromptsThatAreMasks) {
  TrainWith(2);
  v1::EvaluateModelRequest request = Labels(1);
  AddPrompt(request, "3").mutable_mask()->set_png(StoredPng(right, 2, 255, 0));
  const grpc::Status status = Evaluate(request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_GT(Iou(), 0.95);
  EXPECT_THAT(answer.notes(), ElementsAre(HasSubstr("the prompts of 1 views")));
}

TEST_F(EvaluateFramesTest, TakesLabelsAsUprightWithoutThePhotographs) {
  Train({{"half.model", "bytes", v1::FILE_KIND_POSES}});
  const grpc::Status status = Evaluate(Labels(3));
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_LT(Iou(), 0.1);
  EXPECT_THAT(answer.notes(), IsEmpty());
  ExpectRefused(Labels(6), "views[0].labels_png", "upright photograph");
}

}  // namespace
}  // namespace pepeseg
