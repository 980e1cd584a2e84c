#include <gtest/gtest.h>

#include <fstream>

#include "server/store/layout.h"
#include "tests/server/running_server.h"

namespace pepeseg {
namespace {

constexpr int64_t kOfASquare = 10'000;  // Gaussians, in the model of model_worker.cc

// A scene with the model of model_worker.cc: a red square from x -1.1 to -0.1, a blue one from 0.1
// to 1.1.
struct SelectionTest : ::testing::Test {
  SelectionTest() : running(PEPESEG_MODEL_WORKER) {
    running.CreateScene("shelf");
    Train();
  }
  void Train() {
    const v1::Job job = running.Await(running.Train("shelf", "file").name());
    EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.DebugString();
  }

  static v1::CreateSelectionRequest Click(double x) {
    v1::CreateSelectionRequest request;
    request.set_model("scenes/shelf/models/live");
    request.mutable_prompt()->mutable_view()->set_view("middle.jpg");
    auto* point = request.mutable_prompt()->mutable_points()->add_points();
    point->set_x(x);
    point->set_y(32);
    return request;
  }
  static v1::CreateSelectionRequest Red() { return Click(30); }
  static v1::CreateSelectionRequest Blue() { return Click(66); }
  static std::string Name(int number) {
    return "scenes/shelf/selections/" + std::to_string(number);
  }

  grpc::Status Select(const v1::CreateSelectionRequest& request) {
    grpc::ClientContext context;
    made.Clear();
    return running.selections->CreateSelection(&context, request, &made);
  }
  void MustSelect(const v1::CreateSelectionRequest& request) {
    const grpc::Status status = Select(request);
    ASSERT_TRUE(status.ok()) << status.error_message();
  }
  grpc::Status Combine(const std::string& first, const std::string& second,
                       v1::SetOperation operation, const std::string& request_id = "") {
    grpc::ClientContext context;
    v1::CombineSelectionsRequest request;
    request.set_first(first);
    request.set_second(second);
    request.set_operation(operation);
    request.set_request_id(request_id);
    made.Clear();
    return running.selections->CombineSelections(&context, request, &made);
  }
  grpc::Status Undo(const std::string& name) {
    grpc::ClientContext context;
    v1::UndoSelectionRequest request;
    request.set_name(name);
    made.Clear();
    return running.selections->UndoSelection(&context, request, &made);
  }
  grpc::Status Get(const std::string& name) {
    grpc::ClientContext context;
    v1::GetSelectionRequest request;
    request.set_name(name);
    made.Clear();
    return running.selections->GetSelection(&context, request, &made);
  }
  grpc::Status List(const std::string& parent, int page_size, const std::string& token) {
    grpc::ClientContext context;
    v1::ListSelectionsRequest request;
    request.set_parent(parent);
    request.set_page_size(page_size);
    request.set_page_token(token);
    list.Clear();
    return running.selections->ListSelections(&context, request, &list);
  }
  grpc::Status Delete(const std::string& name) {
    grpc::ClientContext context;
    v1::DeleteSelectionRequest request;
    request.set_name(name);
    google::protobuf::Empty empty;
    return running.selections->DeleteSelection(&context, request, &empty);
  }
  void ExpectBadField(const v1::CreateSelectionRequest& request, const std::string& field) {
    const grpc::Status status = Select(request);
    EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT) << field;
    EXPECT_EQ(DetailOf(status).field(), field) << status.error_message();
  }
  static void ExpectResource(const grpc::Status& status, grpc::StatusCode code,
                             const std::string& resource) {
    EXPECT_EQ(status.error_code(), code) << status.error_message();
    EXPECT_EQ(DetailOf(status).resource(), resource) << status.error_message();
  }
  std::filesystem::path File(int number) const {
    return running.options.data / SelectionFolder("shelf") / std::to_string(number);
  }

  RunningServer running;
  v1::Selection made;
  v1::ListSelectionsResponse list;
};

TEST_F(SelectionTest, HoldsTheGaussiansOfWhatIsClicked) {
  MustSelect(Red());
  EXPECT_EQ(made.name(), Name(1));
  EXPECT_EQ(made.model(), "scenes/shelf/models/1");
  EXPECT_NEAR(static_cast<double>(made.num_gaussians()), kOfASquare, 0.01 * kOfASquare);
  ASSERT_TRUE(made.has_box());
  EXPECT_NEAR(made.box().min().x(), -1.1, 0.02);
  EXPECT_NEAR(made.box().max().x(), -0.1, 0.02);
  EXPECT_NEAR(made.box().min().y(), -0.5, 0.02);
  EXPECT_NEAR(made.box().max().y(), 0.5, 0.02);
  EXPECT_EQ(made.box().min().z(), 2);
  EXPECT_EQ(made.base(), "");
  EXPECT_TRUE(made.has_create_time());
  const std::string answer = made.DebugString();
  ASSERT_TRUE(Get(Name(1)).ok());
  EXPECT_EQ(made.DebugString(), answer);
}

TEST_F(SelectionTest, IsEmptyForNothing) {
  auto request = Red();
  request.mutable_granularity()->set_threshold(1);
  MustSelect(request);
  EXPECT_EQ(made.num_gaussians(), 0);
  EXPECT_FALSE(made.has_box());
}

TEST_F(SelectionTest, UnitesSubtractsAndIntersects) {
  MustSelect(Red());
  const int64_t num_red = made.num_gaussians();
  auto request = Blue();
  request.set_base(Name(1));
  request.set_operation(v1::SET_OPERATION_UNION);
  MustSelect(request);
  EXPECT_EQ(made.base(), Name(1));
  EXPECT_NEAR(static_cast<double>(made.num_gaussians()), 2 * kOfASquare, 0.02 * kOfASquare);
  EXPECT_NEAR(made.box().max().x(), 1.1, 0.02);
  ASSERT_TRUE(Combine(Name(2), Name(1), v1::SET_OPERATION_SUBTRACT).ok());
  EXPECT_EQ(made.name(), Name(3));
  EXPECT_EQ(made.base(), Name(2));
  EXPECT_NEAR(made.box().min().x(), 0.1, 0.02);
  ASSERT_TRUE(Combine(Name(2), Name(1), v1::SET_OPERATION_INTERSECT).ok());
  EXPECT_EQ(made.num_gaussians(), num_red);
  ASSERT_TRUE(Combine(Name(3), Name(1), v1::SET_OPERATION_INTERSECT).ok());
  EXPECT_EQ(made.num_gaussians(), 0);
  request = Red();
  request.set_base(Name(3));
  MustSelect(request);
  EXPECT_EQ(made.num_gaussians(), num_red) << "in place of its base";
  EXPECT_EQ(made.base(), Name(3));
}

TEST_F(SelectionTest, ReplacesIfToldOrIfCreatedWithoutAnOperation) {
  MustSelect(Red());
  const int64_t num_red = made.num_gaussians();
  auto request = Blue();
  request.set_operation(v1::SET_OPERATION_REPLACE);
  MustSelect(request);
  EXPECT_EQ(made.base(), "") << "needs no base";
  const int64_t num_blue = made.num_gaussians();
  request = Blue();
  request.set_base(Name(1));
  request.set_operation(v1::SET_OPERATION_REPLACE);
  MustSelect(request);
  EXPECT_EQ(made.base(), Name(1));
  EXPECT_EQ(made.num_gaussians(), num_blue);
  EXPECT_GT(made.box().min().x(), 0) << "of the blue one alone";
  ASSERT_TRUE(Combine(Name(1), Name(2), v1::SET_OPERATION_REPLACE).ok());
  EXPECT_EQ(made.base(), Name(1));
  EXPECT_EQ(made.num_gaussians(), num_blue);
  ASSERT_TRUE(Combine(Name(1), Name(2), v1::SET_OPERATION_UNSPECIFIED).ok());
  EXPECT_EQ(made.num_gaussians(), num_red + num_blue) << "a union";
}

TEST_F(SelectionTest, UndoesToTheBase) {
  MustSelect(Red());
  auto request = Blue();
  request.set_base(Name(1));
  request.set_operation(v1::SET_OPERATION_UNION);
  MustSelect(request);
  ASSERT_TRUE(Undo(Name(2)).ok());
  EXPECT_EQ(made.name(), Name(1));
  ExpectResource(Undo(Name(1)), grpc::FAILED_PRECONDITION, Name(1));
  ASSERT_TRUE(Get(Name(2)).ok()) << "undo deletes nothing";
  ASSERT_TRUE(Delete(Name(1)).ok());
  ExpectResource(Undo(Name(2)), grpc::NOT_FOUND, Name(1));
  ExpectResource(Undo(Name(9)), grpc::NOT_FOUND, Name(9));
}

TEST_F(SelectionTest, ARetryAnswersTheSame) {
  auto request = Red();
  request.set_request_id("r1");
  MustSelect(request);
  MustSelect(request);
  EXPECT_EQ(made.name(), Name(1));
  request.set_num_views(2);
  EXPECT_EQ(Select(request).error_code(), grpc::ALREADY_EXISTS);
  ASSERT_TRUE(Combine(Name(1), Name(1), v1::SET_OPERATION_UNION, "r2").ok());
  EXPECT_EQ(made.name(), Name(2));
  ASSERT_TRUE(Combine(Name(1), Name(1), v1::SET_OPERATION_UNION, "r2").ok());
  EXPECT_EQ(made.name(), Name(2));
  EXPECT_EQ(Combine(Name(1), Name(1), v1::SET_OPERATION_UNION, "r1").error_code(),
            grpc::ALREADY_EXISTS);
}

TEST_F(SelectionTest, ListsNewestFirstPageByPage) {
  MustSelect(Red());
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(Combine(Name(1), Name(1), v1::SET_OPERATION_UNION).ok());
  }
  ASSERT_TRUE(List("scenes/shelf", 2, "").ok());
  ASSERT_EQ(list.selections_size(), 2);
  EXPECT_EQ(list.selections(0).name(), Name(3));
  ASSERT_TRUE(List("scenes/shelf", 2, list.next_page_token()).ok());
  ASSERT_EQ(list.selections_size(), 1);
  EXPECT_EQ(list.selections(0).name(), Name(1));
  EXPECT_EQ(list.next_page_token(), "");
  EXPECT_EQ(List("scenes/shelf", -1, "").error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(List("scenes/none", 0, "").error_code(), grpc::NOT_FOUND);
}

TEST_F(SelectionTest, RemovesFilesWithTheSelectionAndTheScene) {
  MustSelect(Red());
  MustSelect(Blue());
  EXPECT_TRUE(std::filesystem::exists(File(1)));
  ASSERT_TRUE(Delete(Name(1)).ok());
  EXPECT_FALSE(std::filesystem::exists(File(1)));
  ExpectResource(Delete(Name(1)), grpc::NOT_FOUND, Name(1));
  ExpectResource(Get(Name(1)), grpc::NOT_FOUND, Name(1));
  EXPECT_TRUE(std::filesystem::exists(File(2)));
  grpc::ClientContext context;
  v1::DeleteSceneRequest request;
  request.set_name("scenes/shelf");
  google::protobuf::Empty empty;
  ASSERT_TRUE(running.scenes->DeleteScene(&context, request, &empty).ok());
  EXPECT_FALSE(std::filesystem::exists(File(2).parent_path()));
}

TEST_F(SelectionTest, ReportsADamagedFile) {
  MustSelect(Red());
  {
    std::fstream file(File(1), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(100);
    file.put('\x55');
  }
  ExpectResource(Combine(Name(1), Name(1), v1::SET_OPERATION_UNION), grpc::DATA_LOSS, Name(1));
  auto request = Blue();
  request.set_base(Name(1));
  ExpectResource(Select(request), grpc::DATA_LOSS, Name(1));
  EXPECT_TRUE(Get(Name(1)).ok()) << "its row is whole";
}

TEST_F(SelectionTest, RefusesToCombineDifferentModels) {
  MustSelect(Red());
  Train();
  MustSelect(Red());
  EXPECT_EQ(made.model(), "scenes/shelf/models/2");
  ExpectResource(Combine(Name(1), Name(2), v1::SET_OPERATION_UNION), grpc::FAILED_PRECONDITION,
                 "scenes/shelf/models/2");
  auto request = Red();
  request.set_base(Name(1));
  ExpectResource(Select(request), grpc::FAILED_PRECONDITION, "scenes/shelf/models/1");
  request.set_model("scenes/shelf/models/1");
  EXPECT_TRUE(Select(request).ok());
}

TEST_F(SelectionTest, RefusesInvalidRequests) {
  auto request = Red();
  request.set_num_views(101);
  ExpectBadField(request, "num_views");
  request.set_num_views(-1);
  ExpectBadField(request, "num_views");
  request = Red();
  request.set_operation(v1::SET_OPERATION_UNION);
  ExpectBadField(request, "base");
  request.set_operation(static_cast<v1::SetOperation>(17));
  ExpectBadField(request, "operation");
  EXPECT_EQ(DetailOf(Combine(Name(1), Name(1), static_cast<v1::SetOperation>(17))).field(),
            "operation");
  request = Red();
  request.set_base("scenes/shelf/selections/last");
  ExpectBadField(request, "base");
  request.set_base(Name(9));
  ExpectResource(Select(request), grpc::NOT_FOUND, Name(9));
  request = Red();
  request.set_request_id(std::string(129, 'x'));
  ExpectBadField(request, "request_id");
  request = Red();
  request.clear_prompt();
  ExpectBadField(request, "prompt");
  request = Red();
  request.mutable_prompt()->mutable_view()->set_view("nowhere.jpg");
  ExpectBadField(request, "prompt.view.view");
  request = Red();
  request.set_model("shelf");
  ExpectBadField(request, "model");
  EXPECT_EQ(Select(Click(2)).error_code(), grpc::INVALID_ARGUMENT) << "nothing is there";
  ASSERT_TRUE(List("scenes/shelf", 0, "").ok());
  EXPECT_EQ(list.selections_size(), 0);
}

TEST_F(SelectionTest, RefusesInvalidNamesAndOperations) {
  MustSelect(Red());
  EXPECT_EQ(DetailOf(Combine("x", Name(1), v1::SET_OPERATION_UNION)).field(), "first");
  EXPECT_EQ(DetailOf(Combine(Name(1), "x", v1::SET_OPERATION_UNION)).field(), "second");
  EXPECT_EQ(
      DetailOf(Combine(Name(1), Name(1), v1::SET_OPERATION_UNION, std::string(129, 'x'))).field(),
      "request_id");
  ExpectResource(Combine(Name(1), Name(9), v1::SET_OPERATION_UNION), grpc::NOT_FOUND, Name(9));
  ExpectResource(Combine(Name(9), Name(1), v1::SET_OPERATION_UNION), grpc::NOT_FOUND, Name(9));
  for (const char* name : {"", "scenes/shelf/selections/0", "scenes/shelf/models/1"}) {
    EXPECT_EQ(DetailOf(Get(name)).field(), "name") << name;
    EXPECT_EQ(DetailOf(Undo(name)).field(), "name") << name;
    EXPECT_EQ(DetailOf(Delete(name)).field(), "name") << name;
  }
}

}  // namespace
}  // namespace pepeseg
