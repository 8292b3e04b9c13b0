//! x
use pbig_core::*; use pbig_harness::boxes::BoxSet; use std::time::Instant;
fn main(){ let a:Vec<String>=std::env::args().collect(); let set=BoxSet::named(&a[1]).unwrap(); let n:usize=a[2].parse().unwrap(); let b=set.boxes(n,1); let mut f=Finder::new(Config{order:Order::Unspecified,..Config::DEFAULT});
 let mut best=[f64::MAX;4]; for _ in 0..a[3].parse().unwrap(){ let t=Instant::now(); f.find(&b).unwrap(); let e=t.elapsed().as_secs_f64()*1e3; let s=&f.report().stages; for (b,v) in best.iter_mut().zip([e,s.plan.as_secs_f64()*1e3,s.map.as_secs_f64()*1e3,s.check.as_secs_f64()*1e3]){*b=b.min(v);} }
 println!("{} {n}: total {:.3} plan {:.3} map {:.3} check {:.3} | {:?} pairs {} | {}",a[1],best[0],best[1],best[2],best[3],f.report().checks,f.report().pairs,f.report().plan); }
