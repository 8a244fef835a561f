// The shaker: the running level, the limits that stop it, the curves of wear runs, and the stored
// levels.
const amountOf=(held,v)=>v===null||v===undefined?'–':held==='displacement'?(v*1e6).toPrecision(4)+' µm':held==='force'?v.toPrecision(4)+' N':v.toPrecision(4)+' V';
const shakerScreen={key:'shaker',title:'Shaker',make(m){
  this.head=m.appendChild(el('p',{className:'next',id:'level'}));
  this.note=m.appendChild(el('p',{className:'say',id:'level-note'}));
  this.figure=m.appendChild(el('div'));
  this.limits=el('tbody');
  this.guard=m.appendChild(el('div',{},el('h2',{},'What stops the shaker'),el('div',{className:'scroll'},el('table',{},el('thead',{},el('tr',{},...['channel','largest so far','limit','of the limit'].map(t=>el('th',{scope:'col'},t)))),this.limits))));
  this.wear=m.appendChild(el('div'));
  this.rows=el('tbody');
  this.done=m.appendChild(el('div',{},el('h2',{},'Stored levels'),el('div',{className:'scroll'},el('table',{},el('thead',{},el('tr',{},...['level','when','reached','overshoot','after','drive'].map(t=>el('th',{scope:'col'},t)))),this.rows))));
  this.answers=m.appendChild(el('div'));
},show(){
  const w=state.whole,s=w.now.shaker,worn=w.progress.wear_cycles;
  this.guard.hidden=!s;this.figure.hidden=!s;
  if(s){
    const last=s.windows.at(-1);
    this.head.textContent=s.title+': '+(s.over?s.over[0]?'✓ recorded':'✕ not recorded':s.settled?'✓ settled, recording':'∿ approaching');
    // with a controlled drive the motion has no set point
    const measured=s.held==='drive'?'displacement':s.held;
    this.note.textContent=s.over?s.over[1]:last?`${amountOf(measured,last[1])}${s.held==='drive'?'':` of ${amountOf(s.held,s.order)} ordered (${(100*last[1]/s.order).toFixed(1)} %)`}, drive ${last[2].toPrecision(3)} V of at most ${s.most_drive_v.toPrecision(3)} V, after ${last[0].toFixed(1)} s`:'The level is ordered; no value yet.';
    this.note.className=s.over&&!s.over[0]?'refused':'say';
    if(s.windows.length&&Date.now()-(this.asked||0)>300){this.asked=Date.now();picture(this.figure,'/api/now/shaker',true)}
    else if(s.windows.length&&!this.later)this.later=setTimeout(()=>{this.later=0;if(screen===this)this.show()},350);
    this.limits.replaceChildren(...s.limits.map(l=>el('tr',{className:l.largest>=l.limit?'refused':''},el('td',{},l.channel),el('td',{},inUnit(l.largest,l.unit)),el('td',{},inUnit(l.limit,l.unit)),el('td',{},el('meter',{min:0,max:1,high:.8,value:Math.min(1,l.largest/l.limit)}),` ${(100*l.largest/l.limit).toFixed(0)} %`))));
  }else{this.head.textContent=w.levels.length||worn?'The shaker is at rest.':'No level of the shaker was measured.';this.note.textContent=''}
  this.wear.hidden=!worn;
  // a block of cycles comes once a second
  if(worn&&worn!==this.worn){this.worn=worn;picture(this.wear,'/api/wear',true)}
  this.done.hidden=!w.levels.length;
  this.rows.replaceChildren(...w.levels.map(l=>el('tr',{},el('td',{},l.title),el('td',{},l.moment),el('td',{},amountOf(l.held,l.reached)),el('td',{},Math.max(0,100*(l.overshoot-1)).toFixed(1)+' %'),el('td',{},l.after_s.toFixed(1)+' s'),el('td',{},l.drive_v.toPrecision(3)+' V'))));
}};
