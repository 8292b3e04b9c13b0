//! x
use pbig_harness::scenes::Scene; use pbig_harness::runner::Run; use rapier_pbig::PbigBroadPhase; use rapier3d::prelude::*;
fn main(){ let n:usize=std::env::args().nth(1).unwrap().parse().unwrap(); let mut a=Run::new(Scene::named("column").unwrap(),n,1,PbigBroadPhase::new()); let mut b=Run::new(Scene::named("column").unwrap(),n,1,DefaultBroadPhase::new());
 for s in 0..150{a.step();b.step(); if s%15==14 { let r=a.broad_phase.inner.report(); let t=a.times[s]; println!("{s} ours {:.2} stock {:.2} | changed {} checks {:?} pairs {} {:?}",t.broad_phase,b.times[s].broad_phase,r.changed,r.checks,r.pairs,r.stages.named().map(|(n,t)|(n,t.as_micros()))); println!("{}",r.plan); } } }
