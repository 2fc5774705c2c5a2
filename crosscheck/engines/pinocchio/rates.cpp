// Pinocchio's constraintDynamics as C functions of a state for compiled integrators: rates of the state, and
// the state put onto the closures.  A state is q and v.  Driven coordinates have their prescribed values.
#include "pinocchio/multibody.hpp"
#include "pinocchio/multibody/joint.hpp"
#include "pinocchio/algorithm/constrained-dynamics.hpp"
#include "pinocchio/algorithm/crba.hpp"
#include "pinocchio/algorithm/jacobian.hpp"
#include "pinocchio/algorithm/joint-configuration.hpp"
#include "pinocchio/constraints.hpp"

#include <cmath>
#include <cstdint>
#include <exception>
#include <vector>

namespace pin = pinocchio;
using Eigen::Index;
using Matrix = pin::Data::MatrixXs;
using Vector = Eigen::VectorXd;
using State = Eigen::Map<Vector>;
using Given = Eigen::Ref<const Vector>;

namespace {

const double REDUNDANT = 1e-7;     // of the largest row: what is left of a redundant row is below
const double CLOSED = 1e-13;       // m and rad, where Newton's method ends
const double CLOSED_ENOUGH = 1e-8; // m and rad, beyond which it has failed
const int PROJECTIONS = 10;        // of Newton's method at most; two are usual

enum Kind { TURN, SLIDE, BALL, FREE };

struct Joint { Kind kind; int q, v; };

struct Drive { int q, v; double inertia, amplitude, frequency, phase; std::vector<double> polynomial; };

struct Twist { int q, v; double stiffness, natural, damping; };

struct Mechanism {
  pin::Model model;
  pin::Data data;
  pin::RigidConstraintModelVector closures;
  pin::RigidConstraintDataVector closed;
  pin::ProximalSettings solver;
  std::vector<Joint> joints;
  std::vector<Drive> drives;
  std::vector<Twist> twists;
  Vector q, v, torque, constant, change, wanted;
  Matrix rows, jacobian;
  Eigen::LLT<Matrix> root;
  double nothing; // an entry of the Jacobian below is rounding
};

// Values of a driven coordinate at time t into q and v, and the torque of its acceleration.
void prescribe(Mechanism &m, const Drive &d, double t) {
  double value = 0, rate = 0, acceleration = 0;
  for (auto c = d.polynomial.rbegin(); c != d.polynomial.rend(); ++c) {
    acceleration = acceleration * t + 2 * rate;
    rate = rate * t + value;
    value = value * t + *c;
  }
  const double w = d.frequency, phase = w * t + d.phase;
  m.q[d.q] = value + d.amplitude * std::sin(phase);
  m.v[d.v] = rate + d.amplitude * w * std::cos(phase);
  m.torque[d.v] = d.inertia * (acceleration - d.amplitude * w * w * std::sin(phase));
}

void put(Mechanism &m, double t, const double *y) {
  m.q = Eigen::Map<const Vector>(y, m.model.nq);
  m.v = Eigen::Map<const Vector>(y + m.model.nq, m.model.nv);
  m.torque = m.constant;
  if (m.model.nq != m.model.nv) pin::normalize(m.model, m.q);
  for (const Twist &s : m.twists) m.torque[s.v] -= s.stiffness * (m.q[s.q] - s.natural) + s.damping * m.v[s.v];
  for (const Drive &d : m.drives) prescribe(m, d, t);
}

// Rates of q: v, a free joint's turned into the world, quaternions' (x, y, z, w) from body-fixed turning.
void position_rates(const Mechanism &m, double *out) {
  for (const Joint &joint : m.joints) {
    if (joint.kind == TURN || joint.kind == SLIDE) {
      out[joint.q] = m.v[joint.v];
      continue;
    }
    const int moved = joint.kind == FREE ? 3 : 0;
    const Eigen::Quaterniond turned(m.q.segment<4>(joint.q + moved));
    const Eigen::Vector3d spin = m.v.segment<3>(joint.v + moved);
    if (moved) Eigen::Map<Eigen::Vector3d>(out + joint.q) = turned * Eigen::Vector3d(m.v.segment<3>(joint.v));
    const Eigen::Quaterniond rate = turned * Eigen::Quaterniond(0, spin.x() / 2, spin.y() / 2, spin.z() / 2);
    Eigen::Map<Eigen::Vector4d>(out + joint.q + moved) = rate.coeffs();
  }
}

// Closure errors into ``wanted``; the largest.
double errors(Mechanism &m) {
  pin::computeJointJacobians(m.model, m.data, m.q);
  Index row = 0;
  for (size_t k = 0; k < m.closures.size(); ++k) {
    m.closures[k].calc(m.model, m.data, m.closed[k]);
    const pin::SE3 &gap = m.closed[k].c1Mc2;
    m.wanted.segment<3>(row) = gap.translation();
    if (m.closures[k].residualSize() == 6) m.wanted.segment<6>(row) = pin::log6(gap).toVector();
    row += m.closures[k].residualSize();
  }
  return m.wanted.size() ? m.wanted.cwiseAbs().maxCoeff() : 0.0;
}

// The closures' Jacobian at q, without rows that nothing moves but rounding.
void differentiate(Mechanism &m) {
  m.jacobian.setZero();
  pin::getConstraintsJacobian(m.model, m.data, m.closures, m.closed, m.jacobian);
  for (Index i = 0; i < m.jacobian.rows(); ++i)
    if (m.jacobian.row(i).cwiseAbs().maxCoeff() <= m.nothing) m.jacobian.row(i).setZero();
}

// The change of the velocities of least kinetic energy with jacobian * change = wanted.  Rows over the root
// of the mass are made orthonormal, the largest that is left first; those that depend on others count once.
void solve_least(Mechanism &m) {
  m.rows = m.root.matrixL().solve(m.jacobian.transpose()); // a column a row of the Jacobian
  m.change.setZero();
  double enough = 0;
  for (Index k = 0; k < std::min(m.rows.rows(), m.rows.cols()); ++k) {
    Index best;
    const double square = m.rows.rightCols(m.rows.cols() - k).colwise().squaredNorm().maxCoeff(&best);
    if (k == 0) enough = REDUNDANT * REDUNDANT * square;
    if (!(square > enough)) break;
    m.rows.col(k).swap(m.rows.col(k + best));
    std::swap(m.wanted[k], m.wanted[k + best]);
    m.rows.col(k) /= std::sqrt(square);
    m.wanted[k] /= std::sqrt(square);
    for (Index i = k + 1; i < m.rows.cols(); ++i) {
      const double along = m.rows.col(i).dot(m.rows.col(k));
      m.rows.col(i) -= along * m.rows.col(k);
      m.wanted[i] -= along * m.wanted[k];
    }
    m.change += m.wanted[k] * m.rows.col(k);
  }
  m.root.matrixU().solveInPlace(m.change);
}

bool meet(Mechanism &m) {
  pin::crba(m.model, m.data, Given(m.q), pin::Convention::WORLD); // this type is compiled in the library
  m.root.compute(m.data.M.selfadjointView<Eigen::Upper>());
  double worst = errors(m);
  for (int k = 0; worst > CLOSED && k < PROJECTIONS; ++k) {
    differentiate(m);
    solve_least(m);
    m.q = pin::integrate(m.model, m.q, m.change);
    worst = errors(m);
  }
  if (!(worst < CLOSED_ENOUGH)) return false;
  differentiate(m);
  m.wanted = m.jacobian * m.v;
  solve_least(m);
  m.v -= m.change;
  return true;
}

using Three = Eigen::Map<const Eigen::Vector3d>;

// kind, parent, axis (3), place in the parent (3), mass, centre of mass (3), inertia (9)
const int JOINT = 21;

void add_joint(Mechanism &m, const double *n) {
  const pin::SE3 place(Eigen::Matrix3d::Identity(), Three(n + 5));
  const auto parent = pin::JointIndex(n[1]);
  const std::string name = std::to_string(m.model.njoints);
  const Kind kind = Kind(int(n[0]));
  pin::JointIndex j = 0;
  if (kind == TURN) j = m.model.addJoint(parent, pin::JointModelRevoluteUnaligned(Three(n + 2)), place, name);
  if (kind == SLIDE) j = m.model.addJoint(parent, pin::JointModelPrismaticUnaligned(Three(n + 2)), place, name);
  if (kind == BALL) j = m.model.addJoint(parent, pin::JointModelSpherical(), place, name);
  if (kind == FREE) j = m.model.addJoint(parent, pin::JointModelFreeFlyer(), place, name);
  m.model.inertias[j] = pin::Inertia(n[8], Three(n + 9), Eigen::Map<const Eigen::Matrix3d>(n + 12));
  m.joints.push_back({kind, m.model.joints[j].idx_q(), m.model.joints[j].idx_v()});
}

// rows (3 or 6), joints (2), places in the joints (3, 3)
const int CLOSURE = 9;

void add_closure(Mechanism &m, const double *n, double root) {
  const pin::SE3 first(Eigen::Matrix3d::Identity(), Three(n + 3)), second(Eigen::Matrix3d::Identity(), Three(n + 6));
  m.closures.emplace_back(n[0] == 3 ? pin::CONTACT_3D : pin::CONTACT_6D, m.model, pin::JointIndex(n[1]), first,
                          pin::JointIndex(n[2]), second, pin::LOCAL);
  m.closures.back().baumgarte_corrector_parameters() = pin::BaumgarteCorrectorParametersTpl<double>(root * root, 2 * root);
}

void get_ready(Mechanism &m) {
  const Index n = m.model.nv;
  Index rows = 0;
  for (const auto &closure : m.closures) {
    m.closed.emplace_back(closure);
    rows += closure.residualSize();
  }
  m.data = pin::Data(m.model);
  pin::initConstraintDynamics(m.model, m.data, m.closures, m.closed);
  m.q = pin::neutral(m.model);
  m.v = m.torque = m.change = Vector::Zero(n);
  m.wanted = Vector::Zero(rows);
  m.jacobian = Matrix::Zero(rows, n);
  m.rows = Matrix::Zero(n, rows);
  m.root = Eigen::LLT<Matrix>(n);
}

} // namespace

extern "C" {

// A mechanism of ``counts`` joints and closures; null where Pinocchio refuses it.  ``solver``: accuracy, mu,
// iterations, double root of the closure errors (1/s), size of a Jacobian's entry that is rounding.
void *open_mechanism(const int64_t *counts, const double *joints, const double *closures, const double *gravity,
                     const double *torque, const double *armature, const double *solver) {
  try {
    auto *m = new Mechanism;
    m->model.gravity = pin::Motion(Three(gravity), Eigen::Vector3d::Zero());
    for (int64_t k = 0; k < counts[0]; ++k) add_joint(*m, joints + JOINT * k);
    for (int64_t k = 0; k < counts[1]; ++k) add_closure(*m, closures + CLOSURE * k, solver[3]);
    m->model.armature = Eigen::Map<const Vector>(armature, m->model.nv);
    m->constant = Eigen::Map<const Vector>(torque, m->model.nv);
    m->solver = pin::ProximalSettings(solver[0], solver[1], int(solver[2]));
    m->nothing = solver[4];
    get_ready(*m);
    return m;
  } catch (const std::exception &) {
    return nullptr;
  }
}

// places in q and v, armature, amplitude, frequency, phase; coefficients of the polynomial
void add_drive(void *mechanism, const double *n, int64_t length, const double *polynomial) {
  Drive drive{int(n[0]), int(n[1]), n[2], n[3], n[4], n[5], {polynomial, polynomial + length}};
  static_cast<Mechanism *>(mechanism)->drives.push_back(drive);
}

// places in q and v, stiffness, natural angle, damping
void add_twist(void *mechanism, const double *n) {
  static_cast<Mechanism *>(mechanism)->twists.push_back({int(n[0]), int(n[1]), n[2], n[3], n[4]});
}

void close_mechanism(void *mechanism) { delete static_cast<Mechanism *>(mechanism); }

// Rates of a state at time t (s); 0, or 1 where Pinocchio has none.
int32_t rates(void *mechanism, double t, const double *y, double *out) {
  Mechanism &m = *static_cast<Mechanism *>(mechanism);
  try {
    put(m, t, y);
    State(out + m.model.nq, m.model.nv) = pin::constraintDynamics(m.model, m.data, m.q, m.v, m.torque, m.closures,
                                                                  m.closed, m.solver);
    position_rates(m, out);
    return 0;
  } catch (const std::exception &) {
    return 1;
  }
}

// The state put onto the closures by the least kinetic energy; 0, or 1 where they cannot be met.
int32_t settle(void *mechanism, double t, double *y, double *) {
  Mechanism &m = *static_cast<Mechanism *>(mechanism);
  try {
    put(m, t, y);
    if (m.wanted.size() && !meet(m)) return 1;
    State(y, m.model.nq) = m.q;
    State(y + m.model.nq, m.model.nv) = m.v;
    return 0;
  } catch (const std::exception &) {
    return 1;
  }
}
}
