#include "loss_campaign2.hpp"
#include <cstdio>
#include <cstdlib>
using namespace lwr_fri_bridge; using namespace lwr_fri_bridge::test;
int main(int argc,char**argv){ unsigned seeds=argc>1?atoi(argv[1]):100;
 printf("margin %g\n", defaultConfig().position_margin);
 for(double p:{0.010,0.020}) for(double share:{0.01,0.05,0.10}){ unsigned crossed=0,n=0,left=0; double worst=-1e9; char w[100]="";
  for(bool b:{false,true}) for(bool e:{true,false}) for(unsigned s=0;s<seeds;++s){ LossRun r({p,share,b,e,s}); r.begin_at=(int)((s%37)*0.05/p); auto x=r.approach(); ++n; left+=!r.commanding(); if(x.beyond>0){++crossed;} if(x.beyond>worst){worst=x.beyond; snprintf(w,100,"seed %u %s %s begin %d",s,b?"bursts":"single",e?"extrapolates":"stands",r.begin_at);} } 
  printf("%g s %g: runs %u crossed %u worst %.3f mrad left %u  (%s)\n",p,share,n,crossed,1e3*std::max(0.0,worst),left,w); fflush(stdout);} }
