#include <gtest/gtest.h>

#include <fstream>
#include <functional>

#include "server/store/layout.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

constexpr int64_t kOfASquare = 10'000;  // Gaussians, in the model of model_worker.cc

// The red square is from x -1.1 to -0.1, the blue one from 0.1 to 1.1.
struct SelectionTest : ShelfModel {
  static v1::CreateSelectionRequest Red() { return Click<v1::CreateSelectionRequest>(30); }
  static v1::CreateSelectionRequest Blue() { return Click<v1::CreateSelectionRequest>(66); }
  static std::string Name(int number) {
    return "scenes/shelf/selections/" + std::to_string(number);
  }

  Reply<v1::Selection> Select(const v1::CreateSelectionRequest& request) const {
    return Call(&SelectionStub::CreateSelection, request);
  }
  Reply<v1::Selection> Combine(const std::string& first, const std::string& second,
                               v1::SetOperation operation,
                               const std::string& request_id = "") const {
    v1::CombineSelectionsRequest request;
    request.set_first(first);
    request.set_second(second);
    request.set_operation(operation);
    request.set_request_id(request_id);
    return Call(&SelectionStub::CombineSelections, request);
  }
  Reply<v1::Selection> Undo(const std::string& name) const {
    return Call(&SelectionStub::UndoSelection, Named{name});
  }
  Reply<v1::Selection> Get(const std::string& name) const {
    return Call(&SelectionStub::GetSelection, Named{name});
  }
  Reply<v1::Selection> GetWithGaussians(const std::string& name) const {
    v1::GetSelectionRequest request = Named{name};
    request.set_want_gaussians(true);
    return Call(&SelectionStub::GetSelection, request);
  }
  // Picks Gaussians `first` to `last` - 1.
  static v1::CreateSelectionRequest Picked(int64_t first, int64_t last) {
    std::string bits(2 * kOfASquare / 8, '\0');
    for (int64_t i = first; i < last; ++i) {
      bits[i / 8] = static_cast<char>(bits[i / 8] | 1 << (i % 8));
    }
    v1::CreateSelectionRequest request;
    request.set_model(kModel);
    request.mutable_gaussians()->set_bits(bits);
    return request;
  }
  Reply<v1::ListSelectionsResponse> List(const std::string& parent, int page_size,
                                         const std::string& token) const {
    v1::ListSelectionsRequest request = Under{parent};
    request.set_page_size(page_size);
    request.set_page_token(token);
    return Call(&SelectionStub::ListSelections, request);
  }
  grpc::Status Delete(const std::string& name) const {
    return Call(&SelectionStub::DeleteSelection, Named{name});
  }
  std::filesystem::path File(int number) const {
    return running.options.data / SelectionFolder({1, "default", "shelf"}) / std::to_string(number);
  }
};

TEST_F(SelectionTest, HoldsTheGaussiansOfWhatIsClicked) {
  const v1::Selection made = *Select(Red());
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
  EXPECT_EQ(Get(Name(1))->DebugString(), made.DebugString());
}

TEST_F(SelectionTest, IsEmptyForNothing) {
  auto request = Red();
  request.mutable_granularity()->set_threshold(1);
  const v1::Selection made = *Select(request);
  EXPECT_EQ(made.name(), Name(1));
  EXPECT_EQ(made.num_gaussians(), 0);
  EXPECT_FALSE(made.has_box());
}

TEST_F(SelectionTest, HoldsTheGaussiansThatAreGiven) {
  // The last row of the red square, and the first Gaussian of the blue one.
  const v1::CreateSelectionRequest request = Picked(kOfASquare - 100, kOfASquare + 1);
  const v1::Selection made = *Select(request);
  EXPECT_EQ(made.num_gaussians(), 101);
  EXPECT_FLOAT_EQ(static_cast<float>(made.box().min().x()), -1.1f);
  EXPECT_FLOAT_EQ(static_cast<float>(made.box().max().x()), 0.1f);
  EXPECT_FALSE(made.has_gaussians());
  EXPECT_FALSE(Get(Name(1))->has_gaussians()) << "not asked for";
  EXPECT_EQ(GetWithGaussians(Name(1))->gaussians().bits(), request.gaussians().bits());
  EXPECT_EQ(Select(Picked(0, 0))->num_gaussians(), 0);
}

TEST_F(SelectionTest, ReturnsTheGaussiansOfAClick) {
  const v1::Selection made = *Select(Blue());
  const std::string bits = GetWithGaussians(Name(1))->gaussians().bits();
  ASSERT_EQ(bits.size(), 2 * kOfASquare / 8);
  int64_t count = 0;
  for (int64_t i = 0; i < 2 * kOfASquare; ++i) {
    if ((bits[i / 8] >> (i % 8) & 1) == 0) continue;
    ++count;
    EXPECT_GE(i, kOfASquare) << "not of the blue square";
  }
  EXPECT_EQ(count, made.num_gaussians());
}

TEST_F(SelectionTest, CombinesGivenGaussiansWithABase) {
  ASSERT_OK(Select(Picked(0, 1000)));
  auto request = Picked(100, 300);
  request.set_base(Name(1));
  request.set_operation(v1::SET_OPERATION_SUBTRACT);
  const v1::Selection made = *Select(request);
  EXPECT_EQ(made.base(), Name(1));
  EXPECT_EQ(made.num_gaussians(), 800);
}

TEST_F(SelectionTest, RefusesBitsOfAnotherModel) {
  for (const int64_t num_bytes : {int64_t{0}, 2 * kOfASquare / 8 - 1, 2 * kOfASquare / 8 + 1}) {
    auto request = Picked(0, 8);
    request.mutable_gaussians()->set_bits(std::string(num_bytes, '\1'));
    EXPECT_ERROR(Select(request), grpc::INVALID_ARGUMENT, "gaussians.bits");
  }
  EXPECT_EQ(List("scenes/shelf", 0, "")->selections_size(), 0);
}

TEST_F(SelectionTest, KeepsItsName) {
  auto request = Picked(0, 8);
  request.set_display_name("the mug’s handle");
  EXPECT_EQ(Select(request)->display_name(), "the mug’s handle");
  EXPECT_EQ(Get(Name(1))->display_name(), "the mug’s handle");
  EXPECT_EQ(List("scenes/shelf", 0, "")->selections(0).display_name(), "the mug’s handle");
  EXPECT_EQ(Combine(Name(1), Name(1), v1::SET_OPERATION_UNION)->display_name(), "");
  EXPECT_EQ(Undo(Name(2))->display_name(), "the mug’s handle");
  request.set_display_name(std::string(256, 'x'));
  EXPECT_OK(Select(request));
  request.set_display_name(std::string(257, 'x'));
  EXPECT_ERROR(Select(request), grpc::INVALID_ARGUMENT, "display_name");
}

TEST_F(SelectionTest, UnitesSubtractsAndIntersects) {
  const int64_t num_red = Select(Red())->num_gaussians();
  auto request = Blue();
  request.set_base(Name(1));
  request.set_operation(v1::SET_OPERATION_UNION);
  const v1::Selection both = *Select(request);
  EXPECT_EQ(both.base(), Name(1));
  EXPECT_NEAR(static_cast<double>(both.num_gaussians()), 2 * kOfASquare, 0.02 * kOfASquare);
  EXPECT_NEAR(both.box().max().x(), 1.1, 0.02);
  const v1::Selection blue = *Combine(Name(2), Name(1), v1::SET_OPERATION_SUBTRACT);
  EXPECT_EQ(blue.name(), Name(3));
  EXPECT_EQ(blue.base(), Name(2));
  EXPECT_NEAR(blue.box().min().x(), 0.1, 0.02);
  const v1::Selection red = *Combine(Name(2), Name(1), v1::SET_OPERATION_INTERSECT);
  EXPECT_EQ(red.num_gaussians(), num_red);
  EXPECT_EQ(Combine(Name(3), Name(1), v1::SET_OPERATION_INTERSECT)->num_gaussians(), 0);
  request = Red();
  request.set_base(Name(3));
  const v1::Selection replaced = *Select(request);
  EXPECT_EQ(replaced.num_gaussians(), num_red) << "in place of its base";
  EXPECT_EQ(replaced.base(), Name(3));
}

TEST_F(SelectionTest, ReplacesOnRequestOrWithoutAnOperation) {
  const int64_t num_red = Select(Red())->num_gaussians();
  auto request = Blue();
  request.set_operation(v1::SET_OPERATION_REPLACE);
  const v1::Selection blue = *Select(request);
  EXPECT_EQ(blue.base(), "") << "needs no base";
  request.set_base(Name(1));
  const v1::Selection replaced = *Select(request);
  EXPECT_EQ(replaced.base(), Name(1));
  EXPECT_EQ(replaced.num_gaussians(), blue.num_gaussians());
  EXPECT_GT(replaced.box().min().x(), 0) << "of the blue one alone";
  const v1::Selection combined = *Combine(Name(1), Name(2), v1::SET_OPERATION_REPLACE);
  EXPECT_EQ(combined.base(), Name(1));
  EXPECT_EQ(combined.num_gaussians(), blue.num_gaussians());
  EXPECT_EQ(Combine(Name(1), Name(2), v1::SET_OPERATION_UNSPECIFIED)->num_gaussians(),
            num_red + blue.num_gaussians())
      << "a union";
}

TEST_F(SelectionTest, UndoesToTheBase) {
  ASSERT_OK(Select(Red()));
  auto request = Blue();
  request.set_base(Name(1));
  request.set_operation(v1::SET_OPERATION_UNION);
  ASSERT_OK(Select(request));
  EXPECT_EQ(Undo(Name(2))->name(), Name(1));
  EXPECT_ERROR(Undo(Name(1)), grpc::FAILED_PRECONDITION, {.resource = Name(1)});
  ASSERT_OK(Get(Name(2))) << "undo deletes nothing";
  ASSERT_OK(Delete(Name(1)));
  EXPECT_ERROR(Undo(Name(2)), grpc::NOT_FOUND, {.resource = Name(1)});
  EXPECT_ERROR(Undo(Name(9)), grpc::NOT_FOUND, {.resource = Name(9)});
}

TEST_F(SelectionTest, ARetryAnswersTheSame) {
  auto request = Red();
  request.set_request_id("r1");
  ASSERT_OK(Select(request));
  EXPECT_EQ(Select(request)->name(), Name(1));
  request.set_num_views(2);
  EXPECT_ERROR(Select(request), grpc::ALREADY_EXISTS);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(Combine(Name(1), Name(1), v1::SET_OPERATION_UNION, "r2")->name(), Name(2));
  }
  EXPECT_ERROR(Combine(Name(1), Name(1), v1::SET_OPERATION_UNION, "r1"), grpc::ALREADY_EXISTS);
  auto given = Picked(0, 8);
  given.set_request_id("r3");
  EXPECT_EQ(Select(given)->name(), Name(3));
  EXPECT_EQ(Select(given)->name(), Name(3));
  given.mutable_gaussians()->set_bits(Picked(0, 9).gaussians().bits());
  EXPECT_ERROR(Select(given), grpc::ALREADY_EXISTS);
}

TEST_F(SelectionTest, ListsNewestFirstPageByPage) {
  ASSERT_OK(Select(Red()));
  for (int i = 0; i < 2; ++i) ASSERT_OK(Combine(Name(1), Name(1), v1::SET_OPERATION_UNION));
  v1::ListSelectionsResponse list = *List("scenes/shelf", 2, "");
  ASSERT_EQ(list.selections_size(), 2);
  EXPECT_EQ(list.selections(0).name(), Name(3));
  list = *List("scenes/shelf", 2, list.next_page_token());
  ASSERT_EQ(list.selections_size(), 1);
  EXPECT_EQ(list.selections(0).name(), Name(1));
  EXPECT_EQ(list.next_page_token(), "");
  EXPECT_ERROR(List("scenes/shelf", -1, ""), grpc::INVALID_ARGUMENT);
  EXPECT_ERROR(List("scenes/none", 0, ""), grpc::NOT_FOUND);
}

TEST_F(SelectionTest, RemovesFilesWithTheSelectionAndTheScene) {
  ASSERT_OK(Select(Red()));
  ASSERT_OK(Select(Blue()));
  EXPECT_TRUE(std::filesystem::exists(File(1)));
  ASSERT_OK(Delete(Name(1)));
  EXPECT_FALSE(std::filesystem::exists(File(1)));
  EXPECT_ERROR(Delete(Name(1)), grpc::NOT_FOUND, {.resource = Name(1)});
  EXPECT_ERROR(Get(Name(1)), grpc::NOT_FOUND, {.resource = Name(1)});
  EXPECT_TRUE(std::filesystem::exists(File(2)));
  ASSERT_OK(Call(&SceneStub::DeleteScene, Named{"scenes/shelf"}));
  EXPECT_FALSE(std::filesystem::exists(File(2).parent_path()));
}

TEST_F(SelectionTest, ReportsADamagedFile) {
  ASSERT_OK(Select(Red()));
  {
    std::fstream file(File(1), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(100);
    file.put('\x55');
  }
  EXPECT_ERROR(Combine(Name(1), Name(1), v1::SET_OPERATION_UNION), grpc::DATA_LOSS,
               {.resource = Name(1)});
  auto request = Blue();
  request.set_base(Name(1));
  EXPECT_ERROR(Select(request), grpc::DATA_LOSS, {.resource = Name(1)});
  EXPECT_ERROR(GetWithGaussians(Name(1)), grpc::DATA_LOSS, {.resource = Name(1)});
  EXPECT_OK(Get(Name(1))) << "its row is whole";
}

TEST_F(SelectionTest, RefusesToCombineDifferentModels) {
  ASSERT_OK(Select(Red()));
  TrainToTheEnd("shelf", "file");
  EXPECT_EQ(Select(Red())->model(), "scenes/shelf/models/2");
  EXPECT_ERROR(Combine(Name(1), Name(2), v1::SET_OPERATION_UNION), grpc::FAILED_PRECONDITION,
               {.resource = "scenes/shelf/models/2"});
  auto request = Red();
  request.set_base(Name(1));
  EXPECT_ERROR(Select(request), grpc::FAILED_PRECONDITION, {.resource = "scenes/shelf/models/1"});
  request.set_model("scenes/shelf/models/1");
  EXPECT_OK(Select(request));
}

TEST_F(SelectionTest, RefusesInvalidRequests) {
  using Change = std::function<void(v1::CreateSelectionRequest&)>;
  const auto unknown = static_cast<v1::SetOperation>(17);
  const std::vector<std::pair<std::string, Change>> cases = {
      {"num_views", [](auto& request) { request.set_num_views(101); }},
      {"num_views", [](auto& request) { request.set_num_views(-1); }},
      {"base", [](auto& request) { request.set_operation(v1::SET_OPERATION_UNION); }},
      {"operation", [&](auto& request) { request.set_operation(unknown); }},
      {"base", [](auto& request) { request.set_base("scenes/shelf/selections/last"); }},
      {"request_id", [](auto& request) { request.set_request_id(std::string(129, 'x')); }},
      {"prompt", [](auto& request) { request.clear_prompt(); }},
      {"prompt.view.view",
       [](auto& request) { request.mutable_prompt()->mutable_view()->set_view("nowhere.jpg"); }},
      {"model", [](auto& request) { request.set_model("shelf"); }}};
  for (const auto& [field, change] : cases) {
    auto request = Red();
    change(request);
    EXPECT_ERROR(Select(request), grpc::INVALID_ARGUMENT, field);
  }
  EXPECT_ERROR(Combine(Name(1), Name(1), unknown), grpc::INVALID_ARGUMENT, "operation");
  auto request = Red();
  request.set_base(Name(9));
  EXPECT_ERROR(Select(request), grpc::NOT_FOUND, {.resource = Name(9)});
  EXPECT_ERROR(Select(Click<v1::CreateSelectionRequest>(2)), grpc::INVALID_ARGUMENT)
      << "nothing is there";
  EXPECT_EQ(List("scenes/shelf", 0, "")->selections_size(), 0);
}

TEST_F(SelectionTest, RefusesInvalidNamesAndOperations) {
  ASSERT_OK(Select(Red()));
  const auto unite = [this](const std::string& first, const std::string& second) {
    return Combine(first, second, v1::SET_OPERATION_UNION);
  };
  EXPECT_ERROR(unite("x", Name(1)), grpc::INVALID_ARGUMENT, "first");
  EXPECT_ERROR(unite(Name(1), "x"), grpc::INVALID_ARGUMENT, "second");
  EXPECT_ERROR(Combine(Name(1), Name(1), v1::SET_OPERATION_UNION, std::string(129, 'x')),
               grpc::INVALID_ARGUMENT, "request_id");
  EXPECT_ERROR(unite(Name(1), Name(9)), grpc::NOT_FOUND, {.resource = Name(9)});
  EXPECT_ERROR(unite(Name(9), Name(1)), grpc::NOT_FOUND, {.resource = Name(9)});
  for (const char* name : {"", "scenes/shelf/selections/0", "scenes/shelf/models/1"}) {
    EXPECT_ERROR(Get(name), grpc::INVALID_ARGUMENT, "name") << name;
    EXPECT_ERROR(Undo(name), grpc::INVALID_ARGUMENT, "name") << name;
    EXPECT_ERROR(Delete(name), grpc::INVALID_ARGUMENT, "name") << name;
  }
}

}  // namespace
}  // namespace pepeseg
