#include <sstream>

#include "test_support.hpp"

namespace ctrl_more {
namespace {

struct ControlStatesTest : ::testing::Test {
  Logger logger;
  ControlStates control{7, 0.005, &logger};
  Eigen::VectorXd pose = vectorOf({1, 2, 3, 0, 0, 0, 1});
};

TEST_F(ControlStatesTest, EveryContainerReturnsItsValues) {
  const Eigen::VectorXd six = vectorOf({1, 2, 3, 4, 5, 6});
  const Eigen::VectorXd seven = vectorOf({1, 2, 3, 4, 5, 6, 7});
  const Eigen::Vector3d three(1, 2, 3);
  Eigen::VectorXd out;
  Eigen::Vector3d out3;
  ASSERT_TRUE(control.setTaskSpaceReferencePose("ee", pose));
  ASSERT_TRUE(control.getTaskSpaceReferencePose("ee", out));
  EXPECT_EQ(out, pose);
  ASSERT_TRUE(control.setTaskSpaceReferenceVel("ee", six));
  ASSERT_TRUE(control.getTaskSpaceReferenceVel("ee", out));
  EXPECT_EQ(out, six);
  ASSERT_TRUE(control.setTaskSpaceReferenceAcc("ee", six));
  ASSERT_TRUE(control.getTaskSpaceReferenceAcc("ee", out));
  EXPECT_EQ(out, six);
  for (const char* type : {"Position", "Velocity", "Torque"}) {
    ASSERT_TRUE(control.setJointSpaceReference(type, seven));
    ASSERT_TRUE(control.getJointSpaceReference(type, out));
    EXPECT_EQ(out, seven);
  }
  ASSERT_TRUE(control.setOtherReference("horizon", vectorOf({1, 2, 3, 4})));
  ASSERT_TRUE(control.getOtherReference("horizon", out));
  EXPECT_EQ(out.size(), 4);
  ASSERT_TRUE(control.setCoM(three));
  EXPECT_EQ(control.getCoM(), three);
  ASSERT_TRUE(control.setCoMVelocity(three));
  EXPECT_EQ(control.getCoMVelocity(), three);
  ASSERT_TRUE(control.setCoMAcceleration(three));
  EXPECT_EQ(control.getCoMAcceleration(), three);
  ASSERT_TRUE(control.setLinearMomentum(three));
  EXPECT_EQ(control.getLinearMomentum(), three);
  ASSERT_TRUE(control.setAngularMomentum(three));
  EXPECT_EQ(control.getAngularMomentum(), three);
  ASSERT_TRUE(control.setZMP(three));
  EXPECT_EQ(control.getZMP(), three);
  ASSERT_TRUE(control.setZMP("left_foot", three));
  ASSERT_TRUE(control.getZMP("left_foot", out3));
  EXPECT_EQ(out3, three);
}

TEST_F(ControlStatesTest, MissingKeyIsFalseAndTheOutputStays) {
  Eigen::VectorXd out = vectorOf({5});
  EXPECT_FALSE(control.getTaskSpaceReferencePose("ee", out));
  EXPECT_FALSE(control.getTaskSpaceReferenceVel("ee", out));
  EXPECT_FALSE(control.getOtherReference("nothing", out));
  EXPECT_EQ(out, vectorOf({5}));
}

TEST_F(ControlStatesTest, QuaternionsMustBeUnit) {
  EXPECT_FALSE(control.setTaskSpaceReferencePose("ee", vectorOf({0, 0, 0, 0, 0, 0, 0})));
  EXPECT_FALSE(control.setTaskSpaceReferencePose("ee", vectorOf({0, 0, 0, 0, 0, 0, 1.1})));
  EXPECT_FALSE(control.find(ControlContainer::TaskSpaceReferencePose, "ee").valid());
  EXPECT_TRUE(control.setTaskSpaceReferencePose("ee", pose));
  for (const double off : {-1e-6, 1e-6}) {
    const auto turned = [&](double share) {
      return vectorOf({0, 0, 0, 0, 0, 0, 1.0 + share * off});
    };
    EXPECT_TRUE(control.setTaskSpaceReferencePose("ee", turned(0.9))) << off;
    EXPECT_FALSE(control.setTaskSpaceReferencePose("ee", turned(1.1))) << off;
  }
}

TEST_F(ControlStatesTest, JointReferencesHaveTheNumberOfJoints) {
  EXPECT_FALSE(control.setJointSpaceReference("Velocity", Eigen::VectorXd::Zero(6)));
  EXPECT_FALSE(control.setJointSpaceReference("Velocities", Eigen::VectorXd::Zero(7)));
  ControlStates undecided(0, 0.005, &logger);
  EXPECT_TRUE(undecided.setJointSpaceReference("Velocity", Eigen::VectorXd::Zero(6)));
  EXPECT_EQ(undecided.joints(), 6);
  EXPECT_FALSE(undecided.setJointSpaceReference("Torque", Eigen::VectorXd::Zero(7)));
}

TEST_F(ControlStatesTest, PelvisIsIdentityUntilSetAndAlwaysARotation) {
  EXPECT_EQ(control.getPelvisOrientation(), Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
  ASSERT_TRUE(control.setPelvisOrientation(0.1, 0.2, 0.3));
  const Eigen::Matrix3d expected = (Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()))
                                       .toRotationMatrix();
  EXPECT_LT((control.getPelvisOrientation() - expected).norm(), 1e-15);
  Eigen::Matrix3d nearly = expected;
  nearly(0, 0) += 1e-4;
  ASSERT_TRUE(control.setPelvisOrientation(nearly));
  const Eigen::Matrix3d r = control.getPelvisOrientation();
  EXPECT_LT((r * r.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
  EXPECT_FALSE(control.setPelvisOrientation(Eigen::Matrix3d::Zero()));
  EXPECT_FALSE(control.setPelvisOrientation(-expected)) << "a reflection";
  EXPECT_FALSE(control.setPelvisOrientation(Eigen::Matrix3d::Constant(std::nan(""))));
  EXPECT_FALSE(control.setPelvisOrientation(std::nan(""), 0, 0));
}

TEST_F(ControlStatesTest, CopyHasEverything) {
  control.setTaskSpaceReferencePose("ee", pose);
  control.setCoM({1, 2, 3});
  const ControlStates copy = control;
  control.setCoM({9, 9, 9});
  Eigen::VectorXd out;
  EXPECT_TRUE(copy.getTaskSpaceReferencePose("ee", out));
  EXPECT_EQ(out, pose);
  EXPECT_EQ(copy.getCoM(), Eigen::Vector3d(1, 2, 3));
  ControlStates other(control);
  other.copyValuesFrom(copy);
  EXPECT_EQ(other.getCoM(), Eigen::Vector3d(1, 2, 3));
}

TEST_F(ControlStatesTest, OnlyJointReferencesDecideTheNumberOfJoints) {
  ControlStates undecided(0, 0.005, &logger);
  ASSERT_TRUE(undecided.declare(ControlContainer::TaskSpaceReferencePose, "ee", 7));
  ASSERT_TRUE(undecided.declare(ControlContainer::OtherReference, "x", 4));
  EXPECT_EQ(undecided.joints(), 0);
  EXPECT_FALSE(undecided.declare(ControlContainer::JointSpaceReference, "Speed", 6));
  EXPECT_EQ(undecided.joints(), 0);
  ASSERT_TRUE(undecided.declare(ControlContainer::JointSpaceReference, "Velocity", 6));
  EXPECT_EQ(undecided.joints(), 6);
  EXPECT_FALSE(undecided.declare(ControlContainer::TaskSpaceReferencePose, "hand", 6));
  EXPECT_FALSE(undecided.declare(ControlContainer::Zmp, "left", 4));
  Eigen::VectorXd out;
  ASSERT_TRUE(undecided.getTaskSpaceReferencePose("ee", out));
  EXPECT_EQ(out, vectorOf({0, 0, 0, 0, 0, 0, 1})) << "the identity until it is set";
}

TEST_F(ControlStatesTest, HostsWriteByHandle) {
  control.setTaskSpaceReferencePose("ee", pose);
  const Reference<7> ee = control.find<7>(ControlContainer::TaskSpaceReferencePose, "ee");
  control.view(ee)[1] = 9.0;
  const ControlStates& constant = control;
  EXPECT_EQ(constant.view(ee)[1], 9.0);
  EXPECT_EQ(constant.view(ee)[6], 1.0);
  EXPECT_EQ(control.find<AnySize>(ControlContainer::TaskSpaceReferencePose, "ee").size(), 7);
  EXPECT_THROW(control.view(Reference<7>())[0] = 1.0, EmptyHandle);
  EXPECT_THROW(static_cast<void>(constant.view(Reference<7>())), EmptyHandle);
}

}  // namespace
}  // namespace ctrl_more
